"""Brighter, dimmer, tinted, switched: transport is linear in sources, so a picture is mixed from one image of each.

    R' = R + Σ_e (g'_e − g_e) R_e,   or   R' = Σ_e g'_e R_e

with e the elements of light (`vector_of`) and R_e what one gives alone under the same curves, shaded once and found in
the memory from then on. That is exact, and a frame costs the sum of a few images. Whichever formula lacks fewer sources
is taken: a soloed light needs no other's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.look.model import Rgb
from relume.picture.fidelity import Fidelity
from relume.picture.jobs import Job, Place, Settle, Shade, weighted_sum
from relume.picture.light import Light, change_of, is_same_but_for_gains, vector_of
from relume.picture.shown import UNIT_ROUNDOFF, Shown, length_of

F32 = NDArray[np.float32]

_MOST_LACKING = 1  # sources; where there are more, shading all light at once is no slower


@dataclass(frozen=True)
class _Recipe:
    """How much of which elements to add, and to what.

    Attributes:
        from_anchor: to what the term showed before, else to nothing.
        lacking: elements whose image is not there yet.
    """

    from_anchor: bool
    gains: Mapping[Light, Rgb]
    lacking: tuple[Light, ...]

    @property
    def num_lacking(self) -> int:
        """Sources that the lacking elements are of."""
        return len({(element.environment_gain, element.local) for element in self.lacking})


class Mix:
    """A `LightRoute` for gains; nothing has moved."""

    fidelity = Fidelity.EXACT

    def reaches(self, place: Place, light: Light) -> bool:
        """See `LightRoute`."""
        return self._recipe(place, light) is not None

    def needs(self, place: Place, light: Light) -> Sequence[Job]:
        """See `LightRoute`."""
        recipe = self._recipe(place, light)
        return [] if recipe is None else [Shade.of(place, element) for element in recipe.lacking]

    def apply(self, place: Place, light: Light) -> None:
        """See `LightRoute`."""
        live = place.live
        recipe, anchor = self._recipe(place, light), live.ready.anchor
        if recipe is None or recipe.lacking or anchor is None:
            return
        parts = _parts(place, recipe.gains)
        if not recipe.from_anchor:
            mixed = weighted_sum(np.zeros_like(anchor.image), parts)
            live.put(Shown(mixed, Fidelity.EXACT, dict(live.target), light))
            return
        mixed = weighted_sum(anchor.image.copy(), parts)
        left = UNIT_ROUNDOFF * len(parts) ** 0.5 * (length_of(anchor.image) + length_of(mixed))
        rounding = float(np.hypot(anchor.rounding, left))
        live.put(Shown(mixed, anchor.fidelity, dict(live.target), light, rounding=rounding).as_worn())

    def settle_job(self, place: Place) -> Settle | None:
        """What sums an image of all its sources once that was mixed from step to step; None where too few of the
        sources' own images are there."""
        live, gains = place.live, vector_of(place.live.light)
        if self._made_of(place, False, gains).lacking:
            return None
        key = (*place.images.key_of_image(place.material, live, live.light), "settled")
        parts = _parts(place, gains)
        return Settle(place, key, live.ready, lambda image: weighted_sum(image, parts))

    def _recipe(self, place: Place, light: Light) -> _Recipe | None:
        """How the term's image is mixed; None where other things than gains have changed, or too much is lacking."""
        anchor = place.live.ready.anchor
        if anchor is None or anchor.light is None or not is_same_but_for_gains(anchor.light, light):
            return None
        change = self._made_of(place, True, change_of(anchor.light, light))
        if not change.lacking:
            return change
        whole = self._made_of(place, False, vector_of(light))
        best = min(change, whole, key=lambda recipe: recipe.num_lacking)
        return best if not best.lacking or self._may_be_made(place, best) else None

    @staticmethod
    def _may_be_made(place: Place, recipe: _Recipe) -> bool:
        """Whether making what is lacking is worth its while, and the memory has room for it beside other things."""
        needed = 2 * len(recipe.gains) * place.images.image_bytes()
        return recipe.num_lacking <= _MOST_LACKING and needed <= place.images.cache.budget_bytes

    def _made_of(self, place: Place, from_anchor: bool, gains: Mapping[Light, Rgb]) -> _Recipe:
        images, material, live = place
        lacking = tuple(element for element in gains if images.image_in(material, live, element) is None)
        return _Recipe(from_anchor, gains, lacking)


def _parts(place: Place, gains: Mapping[Light, Rgb]) -> list[tuple[F32, Rgb]]:
    """Images of elements of light that the memory has, each with its gain."""
    images, material, live = place
    found = ((images.image_in(material, live, element), gain) for element, gain in gains.items())
    return [(one.image, gain) for one, gain in found if one is not None]
