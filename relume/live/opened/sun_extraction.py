"""Sun disks of environments over an opened bake, and the remaining light of its triangles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.lights.spherical_triangles import EnvironmentTexels, TriangleLights, integrate_environment
from relume.lights.sun_disks import SplitEnvironment, remove_sun_disks
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.free_camera.hard_shadow_lights import HardShadowLight, sun_shadow_targets, unoccluded_sun_vectors
from relume.live.opened.fixed_views import BakedFixedViews, displayed_of
from relume.look import EnvironmentKey
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class SunExtractor:
    """Separates direct illumination by sun disks from the remaining environment of a bake."""

    light_transport: BakedFixedViews

    def _split(self, name: str | None) -> SplitEnvironment:
        """Split an environment, None for the scene's own, into sun disks and the rest."""
        key = self.light_transport.cache_owner(name), "suns", name
        return self.light_transport.cache.get_value(
            key, lambda: remove_sun_disks(self.light_transport.environment_radiance(name))
        )

    def are_in(self, light: Illumination) -> bool:
        """True if a light includes direct illumination by sun disks."""
        return light.has_direct_environment and bool(self._split(light.environment.map).sun_disks)

    def remaining_lights(self, light: Illumination, quality: LightQuality) -> TriangleLights:
        """Return the environment triangles for direct illumination, without sun disks."""
        transport, environment, label = self.light_transport, light.environment.unlinked, "lights without sun disks"
        if not self.are_in(light):
            return transport.direct_lights(light, quality)
        if quality is LightQuality.PREVIEW:
            return displayed_of(transport.coarse_weights(label, environment, self._residual_radiance), light)
        lights = transport.cache.get_value(
            (transport.key, label, environment), lambda: self._integrate_residual(environment)
        )
        return displayed_of(lights, light)

    def _integrate_residual(self, environment: EnvironmentKey) -> TriangleLights:
        return integrate_environment(
            self.light_transport.tiles,
            EnvironmentTexels.from_radiance(self._residual_radiance(environment.map)),
            environment.rotation,
        )

    def _residual_radiance(self, name: str | None) -> F32:
        return self._split(name).residual

    def hard_shadow_lights(self, light: Illumination, points: SurfacePoints) -> Iterator[HardShadowLight]:
        """Yield sun disks for direct illumination, with their unoccluded light at points."""
        if not self.are_in(light):
            return
        key, gain = light.environment.unlinked, np.array(light.environment_gain, np.float32)
        for k, sun_disk in enumerate(self._split(key.map).sun_disks):
            vectors = unoccluded_sun_vectors(sun_disk, key.rotation, points)
            targets, embree = sun_shadow_targets(sun_disk, key.rotation), self.light_transport.local.embree
            yield HardShadowLight((key, k), targets, vectors, gain, embree)
