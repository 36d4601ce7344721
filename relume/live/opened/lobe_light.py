"""Light of an open bake along lobe rays, traced when the lobe is known."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import rotate_about_y, texel_directions
from relume.brdf.lobe_sampling import LobeSampling
from relume.core.errors import StoreError
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import TriangleLights
from relume.live.opened.retrace import NormalRetracer
from relume.methods.patch_layout import read_tree
from relume.patches.patch_kdtree import NO_PATCH_NODE, PatchTree
from relume.raytrace.lobe_directions import LobePattern, make_lobe_pattern
from relume.store.bake_protocol import StoreReader
from relume.transport.lobe_hits import LobeHits, PatchLookup, patch_reach, trace_lobe_rays
from relume.transport.lobe_rays import LobeEnvironment
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]

_NUM_RAYS = ((0.3, 34), (1.0, 55), (2.5, 144), (90.0, 233))
"""Rays of lobes whose median is up to so many degrees."""


class LobeTracer:
    """Traces lobe rays from samples of a bake.

    Args:
        store: the bake's. tracer: with the triangles of the scene.
    """

    def __init__(self, store: StoreReader, tracer: NormalRetracer) -> None:
        self._store, self._tracer = store, tracer

    def pattern(self, lobe: LobeSampling) -> LobePattern:
        """Return the rays of every sample: fewer for a narrow lobe."""
        num_rays = next(num for degrees, num in _NUM_RAYS if np.degrees(lobe.median) <= degrees)
        return make_lobe_pattern(lobe, num_rays, int(self._store.attributes.get("gather_seed", 0)))

    def trace(self, receivers: ShadingPoints, pattern: LobePattern, is_canceled: Callable[[], bool]) -> LobeHits:
        """Trace the rays of points. See `trace_lobe_rays`."""
        points_args = receivers.points, receivers.wo, receivers.level
        return trace_lobe_rays(self._tracer.geometry, self._lookup, *points_args, pattern, is_canceled)

    @cached_property
    def _lookup(self) -> PatchLookup:
        geometry = self._tracer.geometry
        sides = (2 * geometry.face_mesh).astype(np.int32)
        try:
            tree, reach = read_tree(self._store), patch_reach(self._store.read("patches/position"))
        except StoreError:  # direct light alone
            tree, reach = _no_patches(int(sides.max(initial=0)) + 2), patch_reach(np.empty((0, 1, 3), np.float32))
        return PatchLookup(tree, geometry.face_normals, sides, reach)


def _no_patches(num_sides: int) -> PatchTree:
    """Return the tree of a scene without patches."""
    return PatchTree(
        np.zeros(1, np.uint8),
        np.zeros(1, np.float32),
        np.full((1, 2), NO_PATCH_NODE, np.int32),
        np.full(num_sides, NO_PATCH_NODE, np.int32),
    )


def tile_of_texels(tiles: Tiles, shape: tuple[int, int], rotation: float) -> Shaped[NDArray[np.int32], "height width"]:
    """Return the light triangle of each texel of an environment.

    Args:
        tiles: of the bake. shape: height and width of the map. rotation: of the map about +Y, degrees.
    """
    directions = rotate_about_y(texel_directions(*shape).reshape(-1, 3).astype(np.float64), rotation)
    return tiles.locate(directions).reshape(shape)


def lobe_environment(
    radiance: Shaped[F32, "height width 3"],
    tile: Shaped[NDArray[np.int32], "height width"],
    rotation: float,
    lights: TriangleLights,
) -> LobeEnvironment:
    """Return an environment for lobe rays. See `LobeEnvironment`.

    Args:
        radiance: the map, times its gain. tile: from `tile_of_texels`. rotation: degrees. lights: its triangles.
    """
    cosine_sine = np.array([np.cos(np.radians(rotation)), np.sin(np.radians(rotation))], np.float32)
    contiguous = np.ascontiguousarray(radiance, np.float32)
    return LobeEnvironment(contiguous, tile, cosine_sine, lights.direction, lights.radius, lights.solid_angle)
