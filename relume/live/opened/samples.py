"""Samples of an open bake that receive light: all of a material, or some points."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import Illumination
from relume.live.opened.local_lights import LocalLights, ShadowCache
from relume.look import LightGeometry
from relume.raytrace.new_tiles import NewTiles
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.lobe_hits import NO_FOOTPRINT, LobeHits
from relume.transport.shading_points import GatherRays, LocalRays, ShadingPoints
from relume.views.pixel_footprint import pixel_footprint
from relume.views.view import View

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class MaterialSamples:
    """All samples of a material, read when they are lit.

    Attributes:
        view: the view. material: index of the material. local: casts the shadows of local lights.
        cache: cache of these shadows. key: key of the samples in it.
    """

    view: View
    material: int
    local: LocalLights
    cache: Cache
    key: tuple[Hashable, ...]

    num_bytes = 0

    def receivers(
        self, *, is_lit: bool, new_tiles: NewTiles | None = None, is_canceled: Callable[[], bool] = lambda: False
    ) -> ShadingPoints:
        """Read the samples without rays; the visibility of new tiles is cached. See `Samples`."""
        receivers = self.view.receivers(self.material, is_lit=is_lit)
        if new_tiles is None or not is_lit:
            return receivers

        key = *self.key, "visibility", new_tiles.key
        new = self.cache.transient.get_value(
            key, lambda: new_tiles.trace(self.local.embree, receivers.points, is_canceled)
        )
        return replace(receivers, visible=new_tiles.insert(new, receivers.visible))

    def gather_rays(self, is_canceled: Callable[[], bool]) -> GatherRays:
        """Read the gather rays, without light; missing ones are traced."""
        rows = self.view.rows(self.material)
        if rows.start < rows.stop:
            self.view.trace_gather_rays(self.material, is_canceled)
        return self.view.gather_rays(self.material)

    @property
    def mirror_visibility(self) -> Shaped[NDArray[np.uint8], "n bytes"]:
        """The virtual lights that the samples see in planar mirrors."""
        return self.view.mirror_lights(self.material)

    def pixel_footprint(self, receivers: ShadingPoints) -> Shaped[F32, "#n 2 2 3"]:
        """Return the change of normals and view directions in pixels. See `Samples`."""
        view = self.view

        def compute() -> F32:
            return pixel_footprint(view.pixel[view.rows(self.material)], view.width, receivers.points, receivers.wo)

        return self.cache.transient.get_value((*self.key, "pixel footprint"), compute)

    def lobe_hits(self, key: Hashable, trace: Callable[[], LobeHits]) -> LobeHits:
        """Return the hits of lobe rays, cached until the memory is needed."""
        return self.cache.transient.get_value((*self.key, "lobe hits", key), trace)

    def local_rays(self, light: Illumination, points: SurfacePoints) -> Sequence[LocalRays]:
        """Return the rays of local lights, with cached shadows. points: the samples"""

        def cached_shadows(geometry: LightGeometry, points: SurfacePoints) -> ShadowCache:
            _, strata = self.local.sample_light(geometry, self.local.num_samples(geometry))
            num_bytes = len(points.position) * -(-len(strata.uv) // 8)
            return self.cache.get(
                (*self.key, "shadows", geometry), ShadowCache, num_bytes, lambda: self.local.shadows(geometry, points)
            )

        return self.local.rays_to(light, points, cached_shadows)


@dataclass(frozen=True)
class SelectedSamples:
    """Some points, read once to be lit quickly.

    Attributes:
        points: without rays. local: casts the shadows of local lights.
        stored_rays: their gather rays without light; None for none.
        mirror_visibility: the virtual lights that they see in planar mirrors; None for none.
        source: samples whose visibility they have, and which of these; None: their own.
        is_occluded: the scene occludes the environment, as far as its shadows must be traced.
    """

    points: ShadingPoints
    local: LocalLights
    stored_rays: GatherRays | None = None
    mirror_visibility: Shaped[NDArray[np.uint8], "n bytes"] | None = None
    source: tuple[SelectedSamples, Shaped[NDArray[np.intp], " n"]] | None = None
    is_occluded: bool = True

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        points, hit_bytes = self.points, 0 if self.stored_rays is None else self.stored_rays.gather_hits.nbytes
        return int(
            2 * points.normal.nbytes + points.tangent.nbytes + points.wo.nbytes + points.visible.nbytes + hit_bytes
        )

    def receivers(
        self, *, is_lit: bool, new_tiles: NewTiles | None = None, is_canceled: Callable[[], bool] = lambda: False
    ) -> ShadingPoints:
        """Return the points without rays. See `Samples`."""
        if new_tiles is None or not is_lit:
            return self.points
        if self.source is not None:
            source, rows = self.source
            lit = source.receivers(is_lit=is_lit, new_tiles=new_tiles, is_canceled=is_canceled)
            return replace(self.points, visible=lit.visible[rows])
        points = self.points.points
        if self.is_occluded:
            new = new_tiles.trace(self.local.embree, points, is_canceled)
        else:
            new = new_tiles.unoccluded(points)
        return replace(self.points, visible=new_tiles.insert(new, self.points.visible))

    def gather_rays(self, is_canceled: Callable[[], bool]) -> GatherRays | None:
        """Return the gather rays, without light."""
        return self.stored_rays

    def pixel_footprint(self, receivers: ShadingPoints) -> Shaped[F32, "#n 2 2 3"]:
        """Return no change within a pixel: the points are not neighbors."""
        return NO_FOOTPRINT

    def lobe_hits(self, key: Hashable, trace: Callable[[], LobeHits]) -> LobeHits:
        """Return the hits of lobe rays."""
        return trace()

    def local_rays(self, light: Illumination, points: SurfacePoints) -> Sequence[LocalRays]:
        """Return the rays of local lights; shadows are traced."""
        return self.local.rays_to(light, points)
