"""Direct illumination of patches."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.lights.light_sampling import LightStrata
from relume.lights.local_lights import LocalLight, emitter_geometry
from relume.lights.spherical_triangles import TriangleLights
from relume.live.fixed_camera.illumination import Illumination, LightSource
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.opened.harmonic_light import HarmonicLight
from relume.live.opened.local_lights import LocalLights
from relume.look import EnvironmentKey, LightGeometry
from relume.look.model import Link
from relume.math.zernike import OUTGOING_DEGREE
from relume.methods.spherical_harmonic_transfer import PATCH_DEGREE
from relume.radiosity.highlight_transport import DirectLobes
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.patch_mean import mean_coefficients
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator
from relume.raytrace.local_light_visibility import compute_irradiance
from relume.raytrace.moving_light import MovingLight
from relume.transport.incident_coefficients import ray_incident_coefficients
from relume.transport.outgoing_patch_light import NUM_OUTGOING
from relume.transport.shading_points import LocalRays

F32 = NDArray[np.float32]

SAMPLES_PER_PATCH_POINT = 16  # of a rectangle, per sample point of a patch


class LocalPatchLight:
    """Direct illumination of patches by local lights of unit emission.

    Args:
        local: the lights. patches: the receivers.
        cache: cache of results computed from the bake. key: key of the bake in it.
        normal_overrides: see `DirectPatchLight`.
    """

    def __init__(
        self, local: LocalLights, patches: PatchLight, cache: Cache, key: str, normal_overrides: tuple[Hashable, ...]
    ) -> None:
        self._local, self._patches = local, patches
        self._cache, self._key, self._normal_overrides = cache, key, normal_overrides

    def is_lit(self, link: Link | None) -> Shaped[NDArray[np.bool_], " patches"]:
        """True for the patches that a light with this link lights: each is of one mesh."""
        points = self._patches.first_points(np.arange(self._patches.num_patches))
        return self._local.linked.is_lit(link, points.position, points.normal)

    def irradiance(self, geometry: LightGeometry) -> Shaped[F32, " patches"]:
        """Return the irradiance of each patch, averaged over its sample points."""
        key = self._key, "light on patches", geometry, *self._normal_overrides
        return self._cache.get_value(key, lambda: self._irradiance(geometry))

    def _irradiance(self, geometry: LightGeometry) -> F32:
        point_irradiance = compute_irradiance(
            *self._sample_light(geometry), self._patches.points, self._visibility(geometry)
        )
        shape = self._patches.num_patches, self._patches.points_per_patch
        return np.asarray(point_irradiance.reshape(shape).mean(axis=1, dtype=np.float64), np.float32)

    def _visibility(self, geometry: LightGeometry) -> NDArray[np.uint8]:
        def trace() -> NDArray[np.uint8]:
            return self._local.trace(
                geometry, self._patches.points, self._local.num_samples(geometry, SAMPLES_PER_PATCH_POINT)
            )

        return self._cache.get_value(
            (self._key, "shadows on patches", emitter_geometry(geometry), *self._normal_overrides), trace
        )

    def rays(self, geometry: LightGeometry, rows: Shaped[NDArray[np.intp], " G"]) -> LocalRays:
        """Return the light at the sample points of patches `rows`, as rays."""
        visible, points_per_patch = self._visibility(geometry), self._patches.points_per_patch
        bits = visible.reshape(-1, points_per_patch, visible.shape[1])[rows].reshape(-1, visible.shape[1])
        return LocalRays(*self._sample_light(geometry), np.ones(3, np.float32), bits)

    def preview_irradiance(self, geometry: LightGeometry) -> Shaped[F32, " patches"]:
        """Approximate the irradiance of each patch at one of its sample points."""
        return self._preview(geometry).irradiance

    def preview_rays(self, geometry: LightGeometry, rows: Shaped[NDArray[np.intp], " G"]) -> LocalRays:
        """Approximate the light at the first sample points of patches `rows`, as rays."""
        return self._local.preview_rays(LightSource(geometry, (1.0, 1.0, 1.0)), self._preview(geometry).visible[rows])

    def _preview(self, geometry: LightGeometry) -> MovingLight:
        key, patch_rows = (
            (self._key, "preview light on patches", geometry, *self._normal_overrides),
            np.arange(self._patches.num_patches),
        )
        return self._cache.transient.get_value(
            key, lambda: self._local.preview(geometry, self._patches.first_points(patch_rows))
        )

    def _sample_light(self, geometry: LightGeometry) -> tuple[LocalLight, LightStrata]:
        return self._local.sample_light(geometry, self._local.num_samples(geometry, SAMPLES_PER_PATCH_POINT))


class DirectPatchLight:
    """Direct illumination of patches, computed and cached per source: transport is linear in the sources.

    Args:
        patches: the receivers. local: local lights. find_lights: returns the triangles of an environment.
        cache: cache of results computed from the bake. key: key of the bake in it.
        harmonic: transfer of low-frequency light, for previews; None if a bake has none.
        normal_overrides: identifies overridden normals; empty for the baked ones.
    """

    def __init__(
        self,
        patches: PatchLight,
        local: LocalLights,
        find_lights: Callable[[EnvironmentKey, LightQuality], TriangleLights],
        cache: Cache,
        key: str,
        harmonic: HarmonicLight | None = None,
        normal_overrides: tuple[Hashable, ...] = (),
    ) -> None:
        self.patches, self._local = patches, LocalPatchLight(local, patches, cache, key, normal_overrides)
        self._find_lights, self._cache, self._key = find_lights, cache, key
        self._harmonic, self._normal_overrides = harmonic, normal_overrides

    def incident_light(
        self, light: Illumination, reflectance_operator: ReflectanceOperator, *, is_preview: bool
    ) -> IncidentLight:
        """Sum the light of all sources.

        Args:
            light: all light of the scene. reflectance_operator: selects the patches that need directional light.
            is_preview: few samples of local lights, small maps of large environments, low-degree directions.
        """
        incident = IncidentLight(
            np.zeros((self.patches.num_patches, 3), np.float32),
            np.zeros((len(reflectance_operator.rows), 3, NUM_OUTGOING), np.float32),
        )
        local_irradiance = self._local.preview_irradiance if is_preview else self._local.irradiance
        if light.has_environment:
            environment, is_lit = light.environment.unlinked, self._local.is_lit(light.environment.link)[:, None]
            gain = np.array(light.environment_gain, np.float32) * is_lit
            incident.irradiance[:] += gain * self._irradiance(environment, is_preview)
            incident.coefficients[:] += gain[reflectance_operator.rows, :, None] * self._coefficients(
                environment, reflectance_operator, is_preview
            )
        for geometry, source_gain in light.local:
            gain = np.array(source_gain, np.float32)
            incident.irradiance[:] += gain * local_irradiance(geometry)[:, None]
            incident.coefficients[:] += gain[:, None] * self._local_coefficients(
                geometry, reflectance_operator, is_preview
            )
        return incident

    def direct(self, light: Illumination, rows: Shaped[NDArray[np.intp], " G"], *, is_preview: bool) -> DirectLobes:
        """Return the direct light at the sample points of patches `rows`, per source.

        Args:
            light: all light of the scene. rows: the patches.
            is_preview: local lights only at their first points, and small maps of large environments.
        """
        patches, find_rays = self.patches, self._local.preview_rays if is_preview else self._local.rays
        local_rays = ((find_rays(geometry, rows), gain) for geometry, gain in light.local)
        rays = [replace(rays, gain=np.array(gain, np.float32)) for rays, gain in local_rays]
        ray_points = patches.first_points(rows) if is_preview else None
        if not light.has_environment:
            return DirectLobes(rays=rays, ray_points=ray_points)
        lights = self._find_lights(light.environment, LightQuality.PREVIEW if is_preview else LightQuality.EXACT)
        lights = replace(lights, irradiance=np.array(light.environment_gain, np.float32) * lights.irradiance)
        visible = patches.visibility_bits(rows)
        visible[~self._local.is_lit(light.environment.link)[rows]] = 0
        return DirectLobes(lights, visible, rays, ray_points)

    def _exact_lights(self, environment: EnvironmentKey) -> TriangleLights:
        return self._find_lights(environment, LightQuality.EXACT)

    def _irradiance(self, environment: EnvironmentKey, is_preview: bool) -> F32:
        key = self._key, "environment on patches", environment, *self._normal_overrides
        if not is_preview or self._cache.contains(key):
            return self._cache.get_value(key, lambda: self.patches.irradiance(self._exact_lights(environment)))
        preview_key = *key, "preview"
        return self._cache.transient.get_value(preview_key, lambda: self._preview_irradiance(environment))

    def _preview_irradiance(self, environment: EnvironmentKey) -> F32:
        lights, harmonic = self._find_lights(environment, LightQuality.PREVIEW), self._harmonic
        if harmonic is None:
            return self.patches.irradiance(lights, is_preview=True)
        split = harmonic.frequency_split(lights)
        residual = self.patches.irradiance(split.residual, split.residual_triangles, is_preview=True)
        return residual + harmonic.irradiance @ split.low_frequency

    def _coefficients(
        self, environment: EnvironmentKey, reflectance_operator: ReflectanceOperator, is_preview: bool
    ) -> F32:
        patches, rows = self.patches, reflectance_operator.rows
        key = (
            self._key,
            "environment on patches, directional",
            environment,
            reflectance_operator.has_lobe,
            *self._normal_overrides,
        )
        if is_preview:
            preview_key = *key, "preview"
            return self._cache.transient.get_value(preview_key, lambda: self._preview_coefficients(environment, rows))
        return self._cache.get_value(
            key,
            lambda: patches.incident_coefficients(rows, self._exact_lights(environment), OUTGOING_DEGREE),
        )

    def _preview_coefficients(self, environment: EnvironmentKey, rows: NDArray[np.intp]) -> F32:
        lights, harmonic, patches = self._find_lights(environment, LightQuality.PREVIEW), self._harmonic, self.patches
        if harmonic is None:
            return patches.incident_coefficients(rows, lights, PATCH_DEGREE)
        split = harmonic.frequency_split(lights)
        residual = patches.incident_coefficients(rows, split.residual, PATCH_DEGREE, split.residual_triangles)
        low_frequency = np.einsum("gkl,lc->gck", harmonic.patch_coefficients[rows], split.low_frequency)
        return residual + mean_coefficients(patches.tangents(rows), patches.first_points(rows), low_frequency)

    def _local_coefficients(
        self, geometry: LightGeometry, reflectance_operator: ReflectanceOperator, is_preview: bool
    ) -> F32:
        """Coefficients of a light of unit emission; a preview uses one point per patch. (G, 3, J) float32"""
        patches, rows = self.patches, reflectance_operator.rows

        def compute() -> F32:
            if is_preview:
                points, rays = patches.first_points(rows), self._local.preview_rays(geometry, rows)
            else:
                points, rays = patches.points_of(rows), self._local.rays(geometry, rows)
            return mean_coefficients(
                patches.tangents(rows), points, ray_incident_coefficients(points, [rays], OUTGOING_DEGREE)
            )

        cache, label = self._cache.transient if is_preview else self._cache, "light on patches, directional"
        return cache.get_value(
            (self._key, label, geometry, reflectance_operator.has_lobe, is_preview, *self._normal_overrides), compute
        )
