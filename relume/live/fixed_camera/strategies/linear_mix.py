"""Brighter, dimmer, tinted, switched: transport is linear in sources, so a picture is mixed from one image of each.

    R' = R + Σ_e (g'_e − g_e) R_e,   or   R' = Σ_e g'_e R_e

with e the elements of light (`element_gains`) and R_e what one gives alone under the same curves, shaded once and found
in the memory from then on. That is exact, and a frame costs the sum of a few images. Whichever formula lacks fewer
sources is taken: a soloed light needs no other's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.displayed import UNIT_ROUNDOFF, DisplayedImage, norm_of
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, element_gain_changes, element_gains, equal_up_to_gains
from relume.live.fixed_camera.jobs import Job, Resum, Shade, TermTarget, weighted_sum
from relume.look.model import Rgb

F32 = NDArray[np.float32]

_MAX_MISSING_SOURCES = 1  # sources; where there are more, shading all light at once is no slower


@dataclass(frozen=True)
class _Recipe:
    """How much of which elements to add, and to what.

    Attributes:
        from_reference: to what the term showed before, else to nothing.
        missing: elements whose image is not there yet.
    """

    from_reference: bool
    gains: Mapping[Illumination, Rgb]
    missing: tuple[Illumination, ...]

    @property
    def num_missing_sources(self) -> int:
        """Sources that the lacking elements are of."""
        return len({(element.environment_gain, element.local) for element in self.missing})


class LinearMix:
    """A `LightStrategy` for gains; nothing has moved."""

    fidelity = Fidelity.EXACT

    def applicable(self, target: TermTarget, light: Illumination) -> bool:
        """See `LightStrategy`."""
        return self._recipe(target, light) is not None

    def prepare(self, target: TermTarget, light: Illumination) -> Sequence[Job]:
        """See `LightStrategy`."""
        recipe = self._recipe(target, light)
        return [] if recipe is None else [Shade.for_target(target, element) for element in recipe.missing]

    def evaluate(self, target: TermTarget, light: Illumination) -> None:
        """See `LightStrategy`."""
        live = target.live
        recipe, reference = self._recipe(target, light), live.ready.reference
        if recipe is None or recipe.missing or reference is None:
            return
        weighted_images = _weighted_images(target, recipe.gains)
        if not recipe.from_reference:
            mixed = weighted_sum(np.zeros_like(reference.image), weighted_images)
            live.set_ready(DisplayedImage(mixed, Fidelity.EXACT, dict(live.target_bands), light))
            return
        mixed = weighted_sum(reference.image.copy(), weighted_images)
        mixing_error = UNIT_ROUNDOFF * len(weighted_images) ** 0.5 * (norm_of(reference.image) + norm_of(mixed))
        rounding = float(np.hypot(reference.rounding, mixing_error))
        live.set_ready(
            DisplayedImage(
                mixed, reference.fidelity, dict(live.target_bands), light, rounding=rounding
            ).downgrade_if_inexact()
        )

    def resum_job(self, target: TermTarget) -> Resum | None:
        """What sums an image of all its sources once that was mixed from step to step; None where too few of the
        sources' own images are there."""
        live, gains = target.live, element_gains(target.live.light)
        if self._make_recipe(target, False, gains).missing:
            return None
        key = (*target.images.image_key(target.material, live, live.light), "settled")
        weighted_images = _weighted_images(target, gains)
        return Resum(target, key, live.ready, lambda image: weighted_sum(image, weighted_images))

    def _recipe(self, target: TermTarget, light: Illumination) -> _Recipe | None:
        """How the term's image is mixed; None where other things than gains have changed, or too much is lacking."""
        reference = target.live.ready.reference
        if reference is None or reference.light is None or not equal_up_to_gains(reference.light, light):
            return None
        change = self._make_recipe(target, True, element_gain_changes(reference.light, light))
        if not change.missing:
            return change
        whole = self._make_recipe(target, False, element_gains(light))
        best = min(change, whole, key=lambda recipe: recipe.num_missing_sources)
        return best if not best.missing or self._is_affordable(target, best) else None

    @staticmethod
    def _is_affordable(target: TermTarget, recipe: _Recipe) -> bool:
        """Whether making what is lacking is worth its while, and the memory has room for it beside other things."""
        needed = 2 * len(recipe.gains) * target.images.image_bytes()
        return recipe.num_missing_sources <= _MAX_MISSING_SOURCES and needed <= target.images.cache.budget_bytes

    def _make_recipe(self, target: TermTarget, from_reference: bool, gains: Mapping[Illumination, Rgb]) -> _Recipe:
        images, material, live = target
        missing = tuple(element for element in gains if images.image_in(material, live, element) is None)
        return _Recipe(from_reference, gains, missing)


def _weighted_images(target: TermTarget, gains: Mapping[Illumination, Rgb]) -> list[tuple[F32, Rgb]]:
    """Images of elements of light that the memory has, each with its gain."""
    images, material, live = target
    candidates = ((images.image_in(material, live, element), gain) for element, gain in gains.items())
    return [(shaded.image, gain) for shaded, gain in candidates if shaded is not None]
