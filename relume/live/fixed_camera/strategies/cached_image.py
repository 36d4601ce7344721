"""The cached image of the same curves in the target light."""

from __future__ import annotations

from collections.abc import Sequence

from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import Job, TermTarget


class CachedImage:
    """A `LightStrategy` that returns to an earlier state; bit for bit the converged image of that state."""

    fidelity = Fidelity.EXACT

    def applicable(self, target: TermTarget, light: Illumination) -> bool:
        """See `LightStrategy`."""
        images, material, live = target
        return images.image_in(material, live, light) is not None

    def prepare(self, target: TermTarget, light: Illumination) -> Sequence[Job]:
        """See `LightStrategy`; it needs no jobs."""
        return ()

    def evaluate(self, target: TermTarget, light: Illumination) -> None:
        """See `LightStrategy`."""
        images, material, live = target
        cached = images.image_in(material, live, light)
        if cached is not None:
            live.set_ready(DisplayedImage(cached.image.copy(), self.fidelity, dict(live.target_bands), light))
