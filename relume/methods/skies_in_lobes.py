"""Skies as lobes of moving views show them: blurred, their lamps apart, and the lights by which points see them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.environments.equirect import turned
from relume.light.blur import blurred, reduced
from relume.light.suns import LAMPS, Divided, without_suns
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey
from relume.methods.opened.baked_views import BakedViews
from relume.moving.highlights.by_lights import SkyLights
from relume.moving.highlights.lobe_lights import LobeLights, lobe_lights
from relume.moving.sky import Sky, sky_of

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class SkiesInLobes:
    """Of an opened bake. lit: whose light it is."""

    lit: BakedViews

    def _divided(self, name: str | None) -> Divided:
        """An environment without its lamps, None for the scene's own."""
        key = self.lit.owner_of(name), "lamps", name
        return self.lit.memory.keep(key, lambda: without_suns(self.lit.radiance_of(name), LAMPS))

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """The light triangles, those beside each other one after another. (lights,)"""
        return np.argsort(self.lit.tiles.along, kind="stable")

    def sky(self, name: str | None) -> Sky:
        """An environment and what it is when it is blurred without its lamps."""

        def made() -> Sky:
            few = reduced(self._divided(name).beside)
            return sky_of(self.lit.radiance_of(name), lambda degrees: blurred(few, degrees))

        return self.lit.memory.keep((self.lit.owner_of(name), "sky", name), made)

    def lamps(self, environment: EnvironmentKey) -> F32:
        """Lamps of an environment, turned; see `SkyLight`. (lamps, 7) float32"""
        suns = self._divided(environment.map).suns
        mean, light = (
            np.reshape([getattr(sun, name) for sun in suns], (len(suns), 3)) for name in ("mean", "irradiance")
        )
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        direction = turned(mean / length, environment.rotation)
        return np.ascontiguousarray(np.hstack([direction, light, 1 - length]), np.float32)

    def lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLights:
        """The light triangles of an environment, as lobes of some widths look for them, in `order`."""

        def listed() -> LobeLights:
            luminous = luminance(self.lit.preview_lights_in(environment).irradiance)
            suns = self._divided(environment.map).suns
            of_lamps = np.zeros((len(suns), len(luminous)), np.float32)
            for share, sun in zip(of_lamps, suns, strict=True):
                tile = self.lit.tiles.locate(turned(sun.towards.reshape(-1, 3), environment.rotation))
                share += np.bincount(tile, minlength=len(luminous)) / np.float32(len(tile))
            beside = np.maximum(luminous - luminance(self.lamps(environment)[:, 3:6]) @ of_lamps, 0)
            of_lights = self.lit.traced_directions[self.order], self.lit.lights.radius[self.order], beside[self.order]
            return lobe_lights(*of_lights, of_lamps[:, self.order], widths)

        return self.lit.memory.passing.keep((self.lit.key, "lights of lobes", environment, widths), listed)

    def summed(self, environment: EnvironmentKey, *, is_preview: bool) -> SkyLights:
        """The same, as highlights are summed over them. is_preview: of another sky than the baked one, quickly."""
        lit, is_quick = self.lit, is_preview and environment != BAKED_ENVIRONMENT

        def made() -> SkyLights:
            lights = lit.preview_lights_in(environment) if is_quick else lit.lights_in(environment)
            return SkyLights.of(
                *(each[self.order] for each in (lights.direction, lights.irradiance, lit.lights.radius))
            )

        return lit.memory.passing.keep((lit.key, "lights of highlights", environment, is_quick), made)
