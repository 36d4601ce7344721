"""Suns of environments over an opened bake, and the light of its triangles without them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.light.suns import Divided, without_suns
from relume.light.triangles import TriangleLights, Unturned, weigh
from relume.look import EnvironmentKey
from relume.methods.opened.baked_views import BakedViews, shown_of
from relume.moving.beams.beam import Beam, light_of_sun, targets_of_sun
from relume.picture.light import Light
from relume.points import Points

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class SunsOfSkies:
    """What comes straight from suns, and what comes beside them. lit: whose light it is."""

    lit: BakedViews

    def _divided(self, name: str | None) -> Divided:
        """An environment without its suns, None for the scene's own."""
        key = self.lit.owner_of(name), "suns", name
        return self.lit.memory.keep(key, lambda: without_suns(self.lit.radiance_of(name)))

    def are_in(self, light: Light) -> bool:
        """Whether light of suns comes straight to a picture."""
        return light.shows_sky and bool(self._divided(light.environment.map).suns)

    def lights_beside(self, light: Light) -> TriangleLights:
        """The triangles by which light comes straight, without that of suns."""
        if not self.are_in(light):
            return self.lit.lights_of(light)
        key = self.lit.key, "lights beside suns", light.environment
        return shown_of(self.lit.memory.keep(key, lambda: self._weighed(light.environment)), light)

    def preview_lights_beside(self, light: Light) -> TriangleLights:
        """The same, found quickly."""
        if not self.are_in(light):
            return self.lit.preview_lights_of(light)
        return shown_of(self.lit.weighed_quickly("lights beside suns", light.environment, self._beside), light)

    def _weighed(self, environment: EnvironmentKey) -> TriangleLights:
        return weigh(self.lit.tiles, Unturned.of(self._beside(environment.map)), environment.rotation)

    def _beside(self, name: str | None) -> F32:
        return self._divided(name).beside

    def beams(self, light: Light, points: Points) -> Iterator[Beam]:
        """Suns whose light comes straight, and what they bring to points if nothing hides them."""
        if not self.are_in(light):
            return
        key, gain = light.environment, np.array(light.environment_gain, np.float32)
        for k, sun in enumerate(self._divided(key.map).suns):
            vectors = light_of_sun(sun, key.rotation, points)
            yield Beam((key, k), targets_of_sun(sun, key.rotation), vectors, gain)
