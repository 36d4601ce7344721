"""Suns of environments over an opened bake, and the light of its triangles without them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.lights.spherical_triangles import RotatedEnvironment, TriangleLights, integrate_environment
from relume.lights.sun_disks import SplitEnvironment, remove_sun_disks
from relume.live.fixed_camera.illumination import Illumination
from relume.live.free_camera.hard_shadows.lights import HardShadowLight, sun_shadow_targets, unoccluded_sun_vectors
from relume.look import EnvironmentKey
from relume.methods.opened.fixed_views import BakedFixedViews, displayed_of
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class SunExtractor:
    """What comes straight from suns, and what comes beside them. lit: whose light it is."""

    light_transport: BakedFixedViews

    def _split(self, name: str | None) -> SplitEnvironment:
        """An environment without its suns, None for the scene's own."""
        key = self.light_transport.cache_owner(name), "suns", name
        return self.light_transport.cache.get_value(
            key, lambda: remove_sun_disks(self.light_transport.environment_radiance(name))
        )

    def are_in(self, light: Illumination) -> bool:
        """Whether light of suns comes straight to a picture."""
        return light.has_direct_environment and bool(self._split(light.environment.map).sun_disks)

    def remaining_lights(self, light: Illumination) -> TriangleLights:
        """The triangles by which light comes straight, without that of suns."""
        if not self.are_in(light):
            return self.light_transport.lights_for(light)
        key = self.light_transport.key, "lights without sun disks", light.environment
        return displayed_of(
            self.light_transport.cache.get_value(key, lambda: self._integrate_residual(light.environment)), light
        )

    def preview_remaining_lights(self, light: Illumination) -> TriangleLights:
        """The same, found quickly."""
        if not self.are_in(light):
            return self.light_transport.preview_lights_for(light)
        return displayed_of(
            self.light_transport.coarse_weights("lights without sun disks", light.environment, self._residual_radiance),
            light,
        )

    def _integrate_residual(self, environment: EnvironmentKey) -> TriangleLights:
        return integrate_environment(
            self.light_transport.tiles,
            RotatedEnvironment.from_radiance(self._residual_radiance(environment.map)),
            environment.rotation,
        )

    def _residual_radiance(self, name: str | None) -> F32:
        return self._split(name).residual

    def hard_shadow_lights(self, light: Illumination, points: SurfacePoints) -> Iterator[HardShadowLight]:
        """Suns whose light comes straight, and what they bring to points if nothing hides them."""
        if not self.are_in(light):
            return
        key, gain = light.environment, np.array(light.environment_gain, np.float32)
        for k, sun_disk in enumerate(self._split(key.map).sun_disks):
            vectors = unoccluded_sun_vectors(sun_disk, key.rotation, points)
            yield HardShadowLight((key, k), sun_shadow_targets(sun_disk, key.rotation), vectors, gain)
