"""Prefiltered environments for free-camera highlights: blur, bright lights, and lists of lights for lobes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import rotate_about_y
from relume.core.cache import Cache
from relume.core.color import luminance
from relume.lights.prefilter import downsampled, prefiltered
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import TriangleLights
from relume.lights.sun_disks import BRIGHT_LIGHT_BOUNDS, SplitEnvironment, remove_sun_disks
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.free_camera.environment_lookup import EnvironmentLookup, build_environment_lookup
from relume.live.free_camera.highlights.light_sum_kernel import EnvironmentLights
from relume.live.free_camera.highlights.lobe_light_lists import LobeLightLists, build_light_lists
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey

F32 = NDArray[np.float32]


class EnvironmentSource(Protocol):
    """The environments of an opened bake, and its light triangles; `BakedFixedViews` implements it."""

    @property
    def key(self) -> str: ...
    @property
    def cache(self) -> Cache: ...
    @property
    def tiles(self) -> Tiles: ...
    @property
    def lights(self) -> TriangleLights: ...
    @property
    def shadow_ray_directions(self) -> Shaped[F32, "M 3"]: ...
    def cache_owner(self, name: str | None) -> str: ...
    def environment_radiance(self, name: str | None) -> Shaped[F32, "height width 3"]: ...
    def environment_lights(self, environment: EnvironmentKey, quality: LightQuality) -> TriangleLights: ...


@dataclass(frozen=True)
class PrefilteredEnvironments:
    """Prefiltered environments of an opened bake, cached."""

    light_transport: EnvironmentSource

    def _split(self, name: str | None) -> SplitEnvironment:
        """Split an environment, None for the scene's own, into bright lights and the rest."""
        key = self.light_transport.cache_owner(name), "bright lights", name
        return self.light_transport.cache.get_value(
            key, lambda: remove_sun_disks(self.light_transport.environment_radiance(name), BRIGHT_LIGHT_BOUNDS)
        )

    @cached_property
    def order(self) -> Shaped[NDArray[np.intp], " lights"]:
        """Order of the light triangles with neighbors in sequence."""
        return np.argsort(self.light_transport.tiles.traversal_key, kind="stable")

    def environment_lookup(self, name: str | None) -> EnvironmentLookup:
        """Return an environment, and its blurred versions without bright lights."""

        def compute() -> EnvironmentLookup:
            downsampled_radiance = downsampled(self._split(name).residual)
            return build_environment_lookup(
                self.light_transport.environment_radiance(name),
                lambda degrees: prefiltered(downsampled_radiance, degrees),
            )

        key = self.light_transport.cache_owner(name), "sky", name
        return self.light_transport.cache.get_value(key, compute)

    def bright_lights(self, environment: EnvironmentKey) -> Shaped[F32, "lights 7"]:
        """Return the bright lights of an environment, rotated; see `PrefilteredEnvironment`."""
        sun_disks = self._split(environment.map).sun_disks
        mean, light = (
            np.reshape([getattr(sun_disk, name) for sun_disk in sun_disks], (len(sun_disks), 3))
            for name in ("mean", "irradiance")
        )
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        direction = rotate_about_y(mean / length, environment.rotation)
        return np.ascontiguousarray(np.hstack([direction, light, 1 - length]), np.float32)

    def directional_lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLightLists:
        """Return the light triangles of an environment, listed by direction for lobes of some widths, in `order`."""

        def compute() -> LobeLightLists:
            tile_luminance = luminance(
                self.light_transport.environment_lights(environment, LightQuality.PREVIEW).irradiance
            )
            sun_disks = self._split(environment.map).sun_disks
            tile_fractions = np.zeros((len(sun_disks), len(tile_luminance)), np.float32)
            for fractions, sun_disk in zip(tile_fractions, sun_disks, strict=True):
                tile = self.light_transport.tiles.locate(
                    rotate_about_y(sun_disk.directions.reshape(-1, 3), environment.rotation)
                )
                fractions += np.bincount(tile, minlength=len(tile_luminance)) / np.float32(len(tile))
            residual_luminance = np.maximum(
                tile_luminance - luminance(self.bright_lights(environment)[:, 3:6]) @ tile_fractions, 0
            )
            light_arrays = (
                self.light_transport.shadow_ray_directions[self.order],
                self.light_transport.lights.radius[self.order],
                residual_luminance[self.order],
            )
            return build_light_lists(*light_arrays, tile_fractions[:, self.order], widths)

        return self.light_transport.cache.transient.get_value(
            (self.light_transport.key, "lights of lobes", environment.unlinked, widths), compute
        )

    def combined(self, environment: EnvironmentKey, *, is_preview: bool) -> EnvironmentLights:
        """Return an environment's lights for highlights. is_preview: approximates other than the baked environment."""
        environment, light_transport = environment.unlinked, self.light_transport
        is_fast = is_preview and environment != BAKED_ENVIRONMENT

        def compute() -> EnvironmentLights:
            quality = LightQuality.PREVIEW if is_fast else LightQuality.EXACT
            lights = light_transport.environment_lights(environment, quality)
            return EnvironmentLights.from_lights(
                *(values[self.order] for values in (lights.direction, lights.irradiance, light_transport.lights.radius))
            )

        return light_transport.cache.transient.get_value(
            (light_transport.key, "lights of highlights", environment, is_fast), compute
        )
