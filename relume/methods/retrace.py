"""Rays of a baked store, traced for normals that it did not know; shared by all pictures of the bake."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.camera.planar_mirrors import lights_visible_in_mirrors
from relume.core.errors import ChunkDamagedError, StoreError
from relume.methods.local_lights import LocalLights
from relume.methods.planar_mirror_light import MirrorLights
from relume.methods.store_layout import read_shadow_ray_directions, read_tree
from relume.patches.gather_hits import trace_gather_rays
from relume.patches.patch_kdtree import PatchTree
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.scene_buffers import SceneBuffers, offset_point
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import trace_visibility
from relume.store.bake_protocol import StoreReader

F32 = NDArray[np.float32]

_POINTS_PER_BATCH = 4096


class NormalRetracer:
    """The triangles of a store, and where its rays go; a `relume.views.map_override_store.RayTracer`.

    Args:
        local: with the triangles' search tree. mirror_lights: what flat mirrors send exactly, where they do.
    """

    def __init__(self, store: StoreReader, local: LocalLights, mirror_lights: MirrorLights | None) -> None:
        self._store, self._local, self._mirror_lights = store, local, mirror_lights

    def check(self) -> None:
        """Raises StoreError where the store does not say what is needed to trace its rays."""
        if "gather_rays" in self._store.attributes:
            _ = self._geometry

    def visibility(self, points: SurfacePoints, baked_normals: F32, baked_bits: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Find which lights points see: those that come up are traced, those that go down are hidden.

        Args:
            points: as they lean now. baked_normals: their normals when the bake was traced. (n, 3) float32
            baked_bits: what it found. (n, bytes) uint8
        Returns:
            (n, bytes) uint8
        """
        directions = read_shadow_ray_directions(self._store)
        visible = trace_visibility(
            self._local.embree, points.position, points.normal, directions, points.alpha_sample, baked_normals
        ).visible
        for start in range(0, len(visible), _POINTS_PER_BATCH):
            batch = slice(start, start + _POINTS_PER_BATCH)
            above = np.packbits(points.normal[batch] @ directions.T > 0, axis=1, bitorder="little")
            visible[batch] |= baked_bits[batch] & above
        return visible

    def gather_hits(self, points: SurfacePoints, wo: F32, pattern: RayPattern) -> NDArray[np.uint16]:
        """Find the cells that gather rays of points hit.

        Args:
            points: as they lean now. wo: towards the viewer. (n, 3) float32. pattern: of the rays.
        Returns:
            (n, rays) uint16
        """
        return trace_gather_rays(self._geometry, self._tree, points, wo, pattern).patch

    def mirror_lights(self, points: SurfacePoints) -> NDArray[np.uint8]:
        """Find which lights points see in flat mirrors. points: as they lean now. Returns (n, bytes) uint8"""
        assert self._mirror_lights is not None  # who asks has read them from the store
        return lights_visible_in_mirrors(
            self._geometry, self._mirror_lights.mirrors, points, self._mirror_lights.direction
        ).visible

    @cached_property
    def _tree(self) -> PatchTree:
        return read_tree(self._store)

    @cached_property
    def _geometry(self) -> SceneBuffers:
        """What of a scene's triangles rays between surfaces ask for: no normals, no textures."""
        store, positions, faces = self._store, self._local.positions, self._local.faces
        try:
            mesh, material = (store.read(f"scene/{name}") for name in ("face_mesh", "face_material"))
        except ChunkDamagedError:
            raise
        except StoreError:
            raise StoreError("this bake is too old to show images of normals; bake the scene again") from None
        empty = np.empty((0, 3), np.float32)
        return SceneBuffers(
            positions, empty, empty, empty, faces, material, mesh, self._local.embree, offset_point(positions)
        )
