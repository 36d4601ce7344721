"""Lookup of the patches that rays hit, moved randomly within a patch, so that means over rays are interpolated."""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import TEXTURES
from relume.core.numba_options import NO_REFCOUNT
from relume.patches.gather_hits import find_sides
from relume.patches.patch_kdtree import NO_PATCH, PatchTree, locate
from relume.raytrace.lobe_directions import ray_jitter
from relume.raytrace.ray_packet import LANES

F32 = NDArray[np.float32]

_ONE, _TWO = np.float32(1), np.float32(2)
_MAX_SLOTS = len(TEXTURES)
_HALF_WIDTH = 1.25  # of a square, by the spread of uniform points in it


class PatchLookup(NamedTuple):
    """Data to find the patch of a hit.

    Attributes:
        tree: kd-tree of the patches. normals: of the faces. sides: index of each face's front side.
        reach: half the width of each patch, meters; a last one, zero, for `NO_PATCH`.
    """

    tree: PatchTree
    normals: Shaped[F32, "faces 3"]
    sides: Shaped[NDArray[np.int32], " faces"]
    reach: Shaped[F32, " reaches"]


def patch_reach(position: Shaped[F32, "patches points 3"]) -> Shaped[F32, " reaches"]:
    """Estimate half the width of each patch from its sample points; zero in row `NO_PATCH`."""
    spread = position - position.mean(axis=1, keepdims=True)
    reach = np.zeros(NO_PATCH + 1, np.float32)
    reach[: len(position)] = _HALF_WIDTH * np.sqrt(np.square(spread).sum(axis=2).mean(axis=1))
    return reach


class RayLanes(NamedTuple):
    """State of the rays of all lanes.

    Attributes:
        seeds: of the points. keys: position and normal of each hit, moved within about a patch. roots: of its side.
        patches: of the newest hits. last: patch of each path's end. lobe: its newest lobe, −1 before one is met;
            face: its triangle.
        throughput: as in `LobePaths`. normal: of the newest reflection. has_escaped: whether the ray left the scene.
        num_reflections: so far. is_path: whether the ray went on from its first hit.
        spread: width of a ray's footprint by the length of its path. distance: this length, meters.
        angle: between the directions of neighboring rays, after reflections of curved surfaces, radians.
        texture: of the newest hit, see `relume.transport.hit_textures`. texel: memory for a lookup.
        emitter, emission: of the newest hit, as in `LobePaths`.
    """

    seeds: Shaped[NDArray[np.uint32], " lanes"]
    keys: Shaped[F32, "6 lanes"]
    roots: Shaped[NDArray[np.int32], " lanes"]
    patches: Shaped[NDArray[np.int32], " lanes"]
    last: Shaped[NDArray[np.int32], " lanes"]
    lobe: Shaped[NDArray[np.int32], " lanes"]
    face: Shaped[NDArray[np.int32], " lanes"]
    throughput: Shaped[F32, "3 lanes"]
    normal: Shaped[F32, "3 lanes"]
    has_escaped: Shaped[NDArray[np.bool_], " lanes"]
    num_reflections: Shaped[NDArray[np.int32], " lanes"]
    is_path: Shaped[NDArray[np.bool_], " lanes"]
    spread: Shaped[F32, " lanes"]
    distance: Shaped[F32, " lanes"]
    angle: Shaped[F32, " lanes"]
    texture: Shaped[NDArray[np.uint32], "slots lanes"]
    texel: Shaped[F32, " 3"]
    emitter: Shaped[NDArray[np.uint16], " lanes"]
    emission: Shaped[NDArray[np.uint32], " lanes"]


@nb.njit(nogil=True, cache=True)
def allocate_lanes():  # type: ignore[no-untyped-def]
    """Allocate `RayLanes`."""
    return RayLanes(
        np.zeros(LANES, np.uint32), np.zeros((6, LANES), np.float32), np.zeros(LANES, np.int32),
        np.zeros(LANES, np.int32), np.zeros(LANES, np.int32), np.zeros(LANES, np.int32), np.zeros(LANES, np.int32),
        np.zeros((3, LANES), np.float32), np.zeros((3, LANES), np.float32), np.zeros(LANES, np.bool_),
        np.zeros(LANES, np.int32), np.zeros(LANES, np.bool_), np.zeros(LANES, np.float32), np.zeros(LANES, np.float32),
        np.zeros(LANES, np.float32), np.zeros((_MAX_SLOTS, LANES), np.uint32), np.zeros(3, np.float32),
        np.zeros(LANES, np.uint16), np.zeros(LANES, np.uint32),
    )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, inline="always")
def tangents_of(n):  # type: ignore[no-untyped-def]
    """Two tangents of a unit normal, a tuple (Duff 2017, "Building an orthonormal basis, revisited")."""
    sign = _ONE if n[2] >= 0 else -_ONE
    a = -_ONE / (sign + n[2])
    b = n[0] * n[1] * a
    return (_ONE + sign * n[0] * n[0] * a, sign * b, -sign * n[0]), (b, sign + n[1] * n[1] * a, -n[1])


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _jitter(ray, seeds, reach, patches, keys):  # type: ignore[no-untyped-def]
    """Move hits on their tangent planes, within about a patch: the mean over rays is interpolated between patches.

    Args:
        ray: index of the ray. seeds: of the points. (`LANES`,) uint32
        reach: of `PatchLookup`. patches: of the hits. (`LANES`,) keys: positions moved, and normals. (6, `LANES`)
    """
    for k in range(LANES):
        width = reach[patches[k]]
        u, v = ray_jitter(ray, seeds[k])
        u, v = width * (_TWO * u - _ONE), width * (_TWO * v - _ONE)
        nx, ny, nz = keys[3, k], keys[4, k], keys[5, k]
        t, b = tangents_of((nx, ny, nz))
        for axis in range(3):
            keys[axis, k] += u * t[axis] + v * b[axis]


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def locate_smoothly(packet, ray, lookup, lanes):  # type: ignore[no-untyped-def]
    """Find the patches that the rays of all lanes hit, moved within about a patch.

    Args:
        packet: traced rays. ray: their index. lookup: `PatchLookup`. lanes: `RayLanes`, written.
    """
    tree, roots, patches = lookup.tree, lanes.roots, lanes.patches
    find_sides(packet, (lookup.normals, lookup.sides), tree.roots, lanes.keys, roots)
    for k in range(LANES):
        patches[k] = roots[k]
    locate(tree, lanes.keys, patches)
    _jitter(ray, lanes.seeds, lookup.reach, patches, lanes.keys)
    for k in range(LANES):
        patches[k] = roots[k]
    locate(tree, lanes.keys, patches)
