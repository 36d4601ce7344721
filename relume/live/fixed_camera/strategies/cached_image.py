"""The cached image of the same curves in the target light: bit for bit the converged image of an earlier state."""

from __future__ import annotations

from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.strategies.strategy import Strategy
from relume.live.fixed_camera.view_images import TermTarget


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    images, material, live = target
    return live.needs_only_light() and images.image_in(material, live, light) is not None


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    images, material, live = target
    cached = images.image_in(material, live, light)
    if cached is not None:
        live.set_ready(DisplayedImage(cached.image.copy(), Fidelity.EXACT, dict(live.target_bands), light))


CACHED_IMAGE = Strategy(
    name="cached image",
    needs="the same curves and light, shaded before",
    cost="a copy",
    fidelity=Fidelity.EXACT,
    changes_light=True,
    is_ready=_is_ready,
    update=_update,
)
