"""What the memory knows already: the image of the same curves in the wanted light, shaded some time ago."""

from __future__ import annotations

from collections.abc import Sequence

from relume.picture.fidelity import Fidelity
from relume.picture.jobs import Job, Place
from relume.picture.light import Light
from relume.picture.shown import Shown


class Recall:
    """A `LightRoute` back to where the picture has been; bit for bit what it showed there at rest."""

    fidelity = Fidelity.EXACT

    def reaches(self, place: Place, light: Light) -> bool:
        """See `LightRoute`."""
        images, material, live = place
        return images.image_in(material, live, light) is not None

    def needs(self, place: Place, light: Light) -> Sequence[Job]:
        """See `LightRoute`; it is there or it is not."""
        return ()

    def apply(self, place: Place, light: Light) -> None:
        """See `LightRoute`."""
        images, material, live = place
        known = images.image_in(material, live, light)
        if known is not None:
            live.put(Shown(known.image.copy(), self.fidelity, dict(live.target), light))
