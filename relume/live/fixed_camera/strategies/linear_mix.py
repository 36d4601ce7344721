"""Linear light mixing: transport is linear in light sources, so an image is a weighted sum of one image per source.

    R' = R + Σ_e (g'_e − g_e) R_e,   or   R' = Σ_e g'_e R_e

e are the elements of light (`element_gains`), and R_e the image of one element under the same curves, shaded once and
cached. The sum is exact, and a frame costs the sum of a few images. The formula with fewer missing sources is used: a
soloed light needs no other source.
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

_MAX_MISSING_SOURCES = 1  # sources; with more, shading all light at once is no slower


@dataclass(frozen=True)
class _Recipe:
    """The elements to add, their gains, and the base image.

    Attributes:
        from_reference: add to the reference image, else to zero.
        missing: elements without a cached image.
    """

    from_reference: bool
    gains: Mapping[Illumination, Rgb]
    missing: tuple[Illumination, ...]

    @property
    def num_missing_sources(self) -> int:
        """Number of sources of the missing elements."""
        return len({(element.environment_gain, element.local) for element in self.missing})


class LinearMix:
    """A `LightStrategy` for changes of gains without moved lights."""

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
        """Return the job that sums a mixed image once from all its sources; None if images of sources are missing."""
        live, gains = target.live, element_gains(target.live.light)
        if self._make_recipe(target, False, gains).missing:
            return None
        key = (*target.images.image_key(target.material, live, live.light), "settled")
        weighted_images = _weighted_images(target, gains)
        return Resum(target, key, live.ready, lambda image: weighted_sum(image, weighted_images))

    def _recipe(self, target: TermTarget, light: Illumination) -> _Recipe | None:
        """Return how the term's image is mixed; None if more than gains has changed, or too many images are missing."""
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
        """Return whether the missing images are worth their cost and fit half of the memory budget."""
        needed = 2 * len(recipe.gains) * target.images.image_bytes()
        return recipe.num_missing_sources <= _MAX_MISSING_SOURCES and needed <= target.images.cache.budget_bytes

    def _make_recipe(self, target: TermTarget, from_reference: bool, gains: Mapping[Illumination, Rgb]) -> _Recipe:
        images, material, live = target
        missing = tuple(element for element in gains if images.image_in(material, live, element) is None)
        return _Recipe(from_reference, gains, missing)


def _weighted_images(target: TermTarget, gains: Mapping[Illumination, Rgb]) -> list[tuple[F32, Rgb]]:
    """Cached images of elements of light, each with its gain."""
    images, material, live = target
    candidates = ((images.image_in(material, live, element), gain) for element, gain in gains.items())
    return [(shaded.image, gain) for shaded, gain in candidates if shaded is not None]
