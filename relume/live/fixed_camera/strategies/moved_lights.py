"""Direct light of local lights that were moved, evaluated each frame.

Shadows are traced for the current position of a light, for the whole view at once, and held in the transient cache.
Diffuse terms need only irradiance; other terms need rays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_chunks
from relume.lights.spherical_triangles import NO_LIGHTS
from relume.live.fixed_camera.illumination import Illumination, LightSource, direct_from
from relume.live.fixed_camera.jobs import TermTarget, weighted_sum
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.protocols import RaysToSamples
from relume.live.fixed_camera.view_images import ViewImages
from relume.look import LightGeometry
from relume.operators.shade import ShadedTerm, shade_rows, shaded_bytes
from relume.raytrace.light_visibility import compute_irradiance
from relume.raytrace.moving_light import MovingLight
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.roughness_ranges import contract_levels
from relume.transport.shading_points import LocalRays, ShadingPoints
from relume.transport.term_contraction import contract
from relume.views.compose_terms import add_diffuse

F32 = NDArray[np.float32]


class MovedLights:
    """Moved lights for the terms of one view."""

    def __init__(self, images: ViewImages) -> None:
        self._images = images
        self._view_key = images.transfer.key, images.view.name, images.view.maps

    def add_change(
        self, target: TermTarget, before: Illumination, after: Illumination, out: Shaped[F32, "tiles 3 lanes"]
    ) -> None:
        """Add the direct light of new local lights to a term's samples, and subtract that of removed ones.

        Args:
            target: the term. before: light of `out`. after: target light.
            out: image of the term, float32, overwritten.
        """
        if not after.paths.direct:
            return
        _, material, live = target
        removed = [source for source in before.local if source not in after.local]
        added = [source for source in after.local if source not in before.local]
        for source in removed:
            element = direct_from(before, (LightSource(source.geometry, (1.0, 1.0, 1.0)),))
            red, green, blue = source.gain
            weighted_sum(out, [(self._static_image(material, live, element), (-red, -green, -blue))])
        if added:
            self._add_moved(material, live, added, out)

    def add_rays(self, target: TermTarget, added: RaysToSamples, out: Shaped[F32, "tiles 3 lanes"]) -> None:
        """Add light along rays to some samples of a term.

        Args:
            target, out: as in `add_change`. added: the rays.
        """
        _, material, live = target
        samples = added.sample_indices
        if len(samples):
            receivers = replace(self._images.unlit_samples(material).without_light(samples), rays=[added.rays])
            tile, offset = np.divmod(samples, out.shape[2])
            out[tile, :, offset] += self._rows(live, receivers, len(samples), None)

    def _static_image(self, material: MaterialImage, live: LiveTerm, light: Illumination) -> F32:
        """Direct light from a light before it moved, as exact as in the converged image; cached, since every frame uses
        it.

        Usually the scheduler has prefetched it (`StrategyScheduler`).
        """
        images = self._images
        key = images.image_key(material, live, light)

        def shaded() -> ShadedTerm:
            rays, factor = self._exact_rays(material, light), _diffuse_factor(live)
            if factor is None:
                return self._shaded(material, live, rays)
            image, points = np.zeros_like(live.ready.image), self._points().rows(images.view.rows(material.index))
            for light_rays in rays:
                irradiance = compute_irradiance(light_rays.light, light_rays.strata, points, light_rays.visible)
                add_diffuse(irradiance, factor * light_rays.gain, image)
            return ShadedTerm(image)

        return images.cache.get(key, ShadedTerm, shaded_bytes(material.num_samples), shaded).image

    def _exact_rays(self, material: MaterialImage, light: Illumination) -> list[LocalRays]:
        """Rays of a light that has only local lights, as in converged images."""
        _, points = self._images.incident_light(material, light, lambda: False)
        return [rays for rays in points.rays if isinstance(rays, LocalRays)]

    def _add_moved(self, material: MaterialImage, live: LiveTerm, added: list[LightSource], out: F32) -> None:
        factor, rows = _diffuse_factor(live), self._images.view.rows(material.index)
        lights = [(source, self._moving_light(source.geometry)) for source in added]
        if factor is not None:
            for source, light in lights:
                add_diffuse(light.irradiance[rows], factor * source.gain, out)
            return
        local = self._images.transfer.local
        rays = [local.preview_rays(source, light.visible[rows]) for source, light in lights]
        out += self._shaded(material, live, rays, ShadedTerm(out).rows(material.num_samples)).image

    def _moving_light(self, geometry: LightGeometry) -> MovingLight:
        transfer = self._images.transfer
        key = *self._view_key, "moved light", geometry
        return self._images.cache.transient.get_value(key, lambda: transfer.local.preview(geometry, self._points()))

    def _shaded(
        self, material: MaterialImage, live: LiveTerm, rays: list[LocalRays], base_radiance: F32 | None = None
    ) -> ShadedTerm:
        """Shade a term from rays, in the threads of frames. base_radiance: the current image, see `Shader`"""
        receivers = replace(self._images.unlit_samples(material), rays=rays)
        return ShadedTerm.from_rows(self._rows(live, receivers, material.num_samples, base_radiance))

    @staticmethod
    def _rows(live: LiveTerm, receivers: ShadingPoints, num_samples: int, base_radiance: F32 | None) -> F32:
        contractions = contract_levels(live.term, live.target_bands, None)
        rows = np.empty((num_samples, 3), np.float32)

        def add(start: int, stop: int) -> None:
            rows[start:stop] = shade_rows(live.term, contractions, NO_LIGHTS, receivers, start, stop, base_radiance)

        parallel_for_chunks(add, len(rows))
        return rows

    def _points(self) -> SurfacePoints:
        """Surface points of the view; normals of back-facing samples are zero, so that no light arrives."""
        view = self._images.view

        def read() -> SurfacePoints:
            points = view.all_surface_points()
            return points._replace(normal=points.normal * (view.cos_theta_o > 0)[:, None].astype(np.float32))

        return self._images.cache.get_value((*self._view_key, "points"), read)


def _diffuse_factor(live: LiveTerm) -> NDArray[np.float64] | None:
    """Factor of a diffuse term on irradiance; None if the term depends on the incident direction. (3,)"""
    if not live.term.is_lambertian:
        return None
    contraction = contract(live.term, live.target_bands, None)
    if contraction.kinds.size:
        return None
    upright = live.term.quotients(*np.array([0, 0, 1, 0, 0, 1], np.float32))
    return np.asarray(contraction.constant * upright, np.float64)
