"""Rays of a baked store, traced again for overridden normals; shared by all images of the bake."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.planar_mirrors import lights_visible_in_mirrors
from relume.core.errors import StoreError
from relume.live.opened.local_lights import LocalLights
from relume.methods.mirror_lights import MirrorLights
from relume.methods.patch_layout import read_tree
from relume.methods.store_layout import read_shadow_ray_directions
from relume.patches.gather_hits import trace_gather_rays
from relume.patches.patch_kdtree import PatchTree
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import above_horizon, trace_visibility
from relume.store.bake_protocol import StoreReader
from relume.store.optional_arrays import read_optional

F32 = NDArray[np.float32]

_POINTS_PER_BATCH = 4096


class NormalRetracer:
    """Traces the rays of a store again; a `relume.views.map_override_store.RayTracer`.

    Args:
        local: with the acceleration structure. mirror_lights: virtual lights of planar mirrors, if any.
    """

    def __init__(self, store: StoreReader, local: LocalLights, mirror_lights: MirrorLights | None) -> None:
        self._store, self._local, self._mirror_lights = store, local, mirror_lights

    def check(self) -> None:
        """Raise StoreError if the store lacks data for tracing its rays."""
        if "gather_rays" in self._store.attributes:
            _ = self.geometry

    def visibility(
        self, points: SurfacePoints, baked_normals: Shaped[F32, "n 3"], baked_bits: Shaped[NDArray[np.uint8], "n bytes"]
    ) -> Shaped[NDArray[np.uint8], "n bytes"]:
        """Update light visibility: traces lights that rise above the horizon, clears those that set.

        Args:
            points: with the new normals. baked_normals, baked_bits: normals and visibility of the bake.
        """
        directions = read_shadow_ray_directions(self._store)
        visible = trace_visibility(
            self._local.embree, points.position, points.normal, directions, points.alpha_sample, baked_normals
        ).visible
        for start in range(0, len(visible), _POINTS_PER_BATCH):
            batch = slice(start, start + _POINTS_PER_BATCH)
            visible[batch] |= baked_bits[batch] & above_horizon(points.normal[batch], directions)
        return visible

    def gather_hits(
        self, points: SurfacePoints, wo: Shaped[F32, "n 3"], pattern: RayPattern
    ) -> Shaped[NDArray[np.uint16], "n rays"]:
        """Return the patches that gather rays hit.

        Args:
            points: with the new normals. wo: view directions. pattern: pattern of the rays.
        """
        return trace_gather_rays(self.geometry, self._tree, points, wo, pattern).patch

    def mirror_lights(self, points: SurfacePoints) -> Shaped[NDArray[np.uint8], "n bytes"]:
        """Trace the lights that points see in planar mirrors. points: with the new normals"""
        assert self._mirror_lights is not None  # callers have read them from the store
        return lights_visible_in_mirrors(
            self.geometry, self._mirror_lights.mirrors, points, self._mirror_lights.direction
        ).visible

    @cached_property
    def _tree(self) -> PatchTree:
        return read_tree(self._store)

    @cached_property
    def geometry(self) -> SceneBuffers:
        """Triangles for rays between surfaces: without normals and textures."""
        store, positions, faces = self._store, self._local.positions, self._local.faces
        mesh, material = (read_optional(store, f"scene/{name}") for name in ("face_mesh", "face_material"))
        if mesh is None or material is None:
            raise StoreError("this bake is too old to show normal map overrides; bake the scene again")
        normals, tangents, uvs = (np.empty((0, k), np.float32) for k in (3, 4, 2))
        return SceneBuffers(positions, normals, tangents, uvs, faces, material, mesh, self._local.embree)
