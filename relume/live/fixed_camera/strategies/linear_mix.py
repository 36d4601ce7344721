"""Linear light mixing: transport is linear in light sources, so an image is a weighted sum of one image per source.

    R' = R + Σ_e (g'_e − g_e) R_e,   or   R' = Σ_e g'_e R_e

e are the elements of light (`grouped_gains`), and R_e the image of one element under the same curves, shaded once and
cached. The sum is exact, and a frame costs the sum of a few images. The formula with fewer missing sources is used: a
soloed light needs no other source. While a group's fader moves, all its lights have one factor and are one element.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.displayed import UNIT_ROUNDOFF, DisplayedImage, norm_of, weighted_sum
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, equal_up_to_gains, gain_changes, grouped_gains
from relume.live.fixed_camera.jobs import Job
from relume.live.fixed_camera.strategies.resum import resum_job
from relume.live.fixed_camera.strategies.shading import Shading
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency, smallest_material
from relume.live.fixed_camera.view_images import TermTarget
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


def is_applicable(target: TermTarget, light: Illumination) -> bool:
    """Return whether only gains have changed since the reference image, and few images of sources are missing."""
    return target.live.needs_only_light() and _recipe(target, light) is not None


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    recipe = _recipe(target, light) if target.live.needs_only_light() else None
    return recipe is not None and not recipe.missing


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    live = target.live
    recipe, reference = _recipe(target, light), live.ready.reference
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


def _source_job(situation: Situation) -> Job | None:
    """Return the job for a missing image of a light element, of the material with the fewest samples first."""
    light = situation.images.light

    def job(target: TermTarget) -> Job | None:
        recipe = _recipe(target, light)
        return None if recipe is None or not recipe.missing else Shading.for_target(target, recipe.missing[0]).job()

    return smallest_material((target, job(target)) for target in situation.targets if target.live.needs_only_light())


def _resum_job(situation: Situation) -> Job | None:
    """Return the job that sums a mixed image once from all its sources; None if images of sources are missing."""
    for target in situation.targets:
        live = target.live
        is_mixed = live.is_converged and live.ready.basis is None and live.ready.rounding > 0
        if not is_mixed or live.changed_curves():
            continue
        recipe = _best(_make_recipe(target, False, grouped_gains(live.light, groups)) for groups in _groupings(target))
        if not recipe.missing:
            weighted_images = _weighted_images(target, recipe.gains)
            key = target.images.image_key(target.material, live, live.light)
            return resum_job(target, key, partial(weighted_sum, weighted_images=weighted_images))
    return None


def _recipe(target: TermTarget, light: Illumination) -> _Recipe | None:
    """Return how the term's image is mixed; None if more than gains has changed, or too many images are missing."""
    reference = target.live.ready.reference
    if reference is None or reference.light is None or not equal_up_to_gains(reference.light, light):
        return None
    before, groupings = reference.light, _groupings(target)
    changes = (_make_recipe(target, True, gain_changes(before, light, groups)) for groups in groupings)
    sums = (_make_recipe(target, False, grouped_gains(light, groups)) for groups in groupings)
    best = _best(chain(changes, sums))
    return best if not best.missing or _is_affordable(target, best) else None


def _groupings(target: TermTarget) -> Iterable[tuple[Illumination, ...]]:
    """Return the sets of groups whose lights may be one element: all groups, and none."""
    groups = tuple(target.images.groups.values())
    return (groups, ()) if groups else ((),)


def _best(recipes: Iterable[_Recipe]) -> _Recipe:
    """Return the first recipe with the fewest missing sources; no later one is made after a complete one."""
    candidates = list[_Recipe]()
    for recipe in recipes:
        if not recipe.missing:
            return recipe
        candidates.append(recipe)
    return min(candidates, key=lambda recipe: recipe.num_missing_sources)


def _is_affordable(target: TermTarget, recipe: _Recipe) -> bool:
    """Return whether the missing images are worth their cost and fit half of the memory budget."""
    needed = 2 * len(recipe.gains) * target.images.image_bytes()
    return recipe.num_missing_sources <= _MAX_MISSING_SOURCES and needed <= target.images.cache.budget_bytes


def _make_recipe(target: TermTarget, from_reference: bool, gains: Mapping[Illumination, Rgb]) -> _Recipe:
    images, material, live = target
    missing = tuple(element for element in gains if images.image_in(material, live, element) is None)
    return _Recipe(from_reference, gains, missing)


def _weighted_images(target: TermTarget, gains: Mapping[Illumination, Rgb]) -> list[tuple[F32, Rgb]]:
    """Cached images of elements of light, each with its gain."""
    images, material, live = target
    candidates = ((images.image_in(material, live, element), gain) for element, gain in gains.items())
    return [(shaded.image, gain) for shaded, gain in candidates if shaded is not None]


LINEAR_MIX = Strategy(
    name="linear mix",
    needs="one image per light source, or light group",
    cost="a sum of images",
    fidelity=Fidelity.EXACT,
    changes_light=True,
    is_ready=_is_ready,
    update=_update,
    jobs={Urgency.LIGHT_SOURCE: _source_job, Urgency.REFINEMENT: _resum_job},
)
