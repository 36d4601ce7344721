"""Brighter, dimmer, tinted, switched: transport is linear in sources, so a picture is mixed from one image of each.

    R' = R + Σ_s (g'_s − g_s) R_s,   or   R' = Σ_s g'_s R_s

with R_s what source s gives alone under the same curves, shaded once and then found in the cache. That is exact, and a
frame costs the sum of two images. Whichever formula lacks fewer images is taken: a soloed light needs no other's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from relume.look import LightGeometry
from relume.look.model import Rgb
from relume.transfer.light import Light, gains_of, is_same_but_for_gains, of_source, straight_from
from relume.transfer.material_image import MaterialImage
from relume.transfer.need import Need, need_of_image
from relume.transfer.shade import Shaded, shaded_bytes
from relume.transfer.term_image import TermImage
from relume.transfer.view_images import ViewImages

_MOST_LACKING = 1  # images; where there are more, shading all light at once is no slower


@dataclass(frozen=True)
class _Recipe:
    """Images of sources alone, and how much of each to add.

    Attributes:
        from_base: to what the term showed before, else to nothing.
        lacking: sources whose image is not there yet.
    """

    from_base: bool
    gains: Mapping[Light, Rgb]
    lacking: tuple[Light, ...]


class Mixer:
    """Of the terms of one view."""

    def __init__(self, images: ViewImages) -> None:
        self._images = images
        self._held: LightGeometry | None = None

    def hold(self, geometry: LightGeometry | None) -> None:
        """A hand is on a local light, or on none."""
        self._held = geometry

    def mixes_all(self) -> bool:
        """Whether every term that lacks its light can have it at once."""
        return all(self.mixes(*found) for found in self._unlit())

    def mixes(self, material: MaterialImage, image: TermImage) -> bool:
        """Whether a term can have the light of the look at once."""
        recipe = self._recipe(material, image) if image.can_follow() else None
        return recipe is not None and not recipe.lacking

    def next_need(self) -> Need | None:
        """The image of a source that is lacking, of a material with few samples first."""
        recipes = [(*found, self._recipe(*found)) for found in self._unlit()]
        lacking = [(m, t, recipe.lacking[0]) for m, t, recipe in recipes if recipe is not None and recipe.lacking]
        if not lacking:
            return None
        material, image, source = min(lacking, key=lambda item: item[0].num_samples)
        return need_of_image(self._images, material, image, source)

    def held_need(self) -> Need | None:
        """An image of the light that a hand is on, of a material with few samples first; it can wait for all else.

        What comes straight from it is taken off as soon as it moves; all that comes from it is what it is dimmed by.
        None where that light is elsewhere by now, or where the cache has no room to spare.
        """
        light, cache = self._images.light, self._images.cache
        held = tuple(source for source in light.local if source.geometry == self._held)
        if self._held is None or not held:
            return None
        wanted = straight_from(light, held), of_source(light, self._held)
        lacking = [(s, m, t) for s in wanted for m, t in self._images.terms() if self._alone(m, t, s) is None]
        num_bytes = sum(shaded_bytes(material.num_samples) for _, material, _ in lacking)
        if not lacking or num_bytes > cache.budget_bytes - cache.used_bytes:
            return None
        source, material, image = min(lacking, key=lambda item: (item[0] != wanted[0], item[1].num_samples))
        return replace(need_of_image(self._images, material, image, source), refines=True)

    def step(self) -> None:
        """Mix all terms that can be."""
        for material, image in self._unlit():
            recipe = self._recipe(material, image)
            if recipe is None or recipe.lacking:
                continue
            parts = [(self._alone(material, image, source), gain) for source, gain in recipe.gains.items()]
            image.mix([(part.image, gain) for part, gain in parts if part is not None], from_base=recipe.from_base)

    def _unlit(self) -> Iterator[tuple[MaterialImage, TermImage]]:
        """Terms that show their curves in another light."""
        return ((material, image) for material, image in self._images.terms() if image.can_follow())

    def _recipe(self, material: MaterialImage, image: TermImage) -> _Recipe | None:
        """How the term's image is mixed; None where other things than gains have changed."""
        light, base = self._images.light, image.base
        if base is None or not is_same_but_for_gains(base.light, light):
            return None
        before, after = gains_of(base.light), gains_of(light)
        change = {source: _difference(after.get(source), before.get(source)) for source in {**before, **after}}
        change = {source: gain for source, gain in change.items() if any(gain)}
        options = [self._made_of(material, image, *option) for option in ((True, change), (False, after))]
        best = min(options, key=lambda recipe: len(recipe.lacking))
        return best if len(best.lacking) <= _MOST_LACKING else None

    def _made_of(
        self, material: MaterialImage, image: TermImage, from_base: bool, gains: Mapping[Light, Rgb]
    ) -> _Recipe:
        lacking = tuple(source for source in gains if self._alone(material, image, source) is None)
        return _Recipe(from_base, gains, lacking)

    def _alone(self, material: MaterialImage, image: TermImage, source: Light) -> Shaded | None:
        return self._images.cache.find(self._images.key_of_image(material, image, source), Shaded)


def _difference(after: Rgb | None, before: Rgb | None) -> Rgb:
    red, green, blue = np.subtract(after or (0.0, 0.0, 0.0), before or (0.0, 0.0, 0.0)).tolist()
    return red, green, blue
