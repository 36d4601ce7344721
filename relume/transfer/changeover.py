"""One picture, one light: what a picture shows in another light it shows there all at once.

When light changes, images of terms become ready one after another: mixed, followed, glimpsed or shaded. Until all of
them are in one light the picture goes on showing those in the light before, with the background, the shining surfaces
and the gain of that light; colours and textures are the look's throughout.
"""

from __future__ import annotations

from relume.transfer.glimpse import Glimpse
from relume.transfer.view_images import ViewImages


class Changeover:
    """Of one view.

    Attributes:
        light: in which the picture is shown. gain: what multiplies it.
    """

    def __init__(self, images: ViewImages) -> None:
        self._images = images
        self.light, self.gain = images.light, images.gain
        images.shine_in(self.light)

    def step(self, glimpse: Glimpse | None) -> None:
        """Show every term's newest image, if all are in one light; those that show nothing at all are in any.

        Args:
            glimpse: what was just made, perhaps for an earlier light than the look's.
        """
        images, before = self._images, self.light
        lit = [image.lit for _, image in images.terms() if not image.is_blank]
        if all(light == images.light for light in lit):
            self.light, self.gain = images.light, images.gain
        elif glimpse is not None and all(light == glimpse.light for light in lit):
            self.light, self.gain = glimpse.light, glimpse.gain
        else:
            return
        for _, image in images.terms():
            image.release()
        if self.light != before:
            images.shine_in(self.light)
