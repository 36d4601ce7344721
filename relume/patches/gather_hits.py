"""Final gathering, hits: the patch that each gather ray of a pixel, probe or patch point hits."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.patches.patch_kdtree import NO_PATCH, NO_PATCH_NODE, PatchTree, locate
from relume.raytrace.gather_rays import RayPattern, cosine_ray, glossy_ray, lattice_offsets
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    enable_stochastic_alpha,
    get_direction,
    get_hit,
    get_position,
    new_packet,
    set_direction,
    set_origin,
    trace_hits,
)
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]

_MAX_HEIGHT = np.float32(2)  # of an origin above its own triangle, in offsets: the offset and as much rounding
_POINTS_PER_RANGE = 256
_MAX_COHERENT_TRIANGLES = 20_000  # rays of neighboring points traverse trees of more triangles faster one by one


@dataclass(frozen=True)
class GatherHits:
    """Hits of the gather rays of n points.

    Attributes:
        patch: index of the patch that each ray hits, `NO_PATCH` if it leaves the scene, goes into its own triangle
            (see `_hits_own_face`) or was not traced.
        num_rays: number of traced rays. trace_s: wall time of the tracing alone.
    """

    patch: Shaped[NDArray[np.uint16], "n rays"]
    num_rays: int
    trace_s: float


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _load_points(points, wo, pattern, first, width, packet, frame, local_wo, offsets):  # type: ignore[no-untyped-def]
    """Load points [first, first + width): ray origins, local frames, offsets; one lane each.

    wo: (n, 3). frame: tangent, bitangent, normal. (3, 3, `LANES`) offsets: (2 sets, 4, `LANES`)
    """
    position, normal, tangent, seed, alpha_sample = points
    for k in range(LANES):
        p = first + min(k, width - 1)
        n, t, o = normal[p], tangent[p], wo[p]
        b = (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])
        set_origin(packet, k, position[p, 0], position[p, 1], position[p, 2])
        enable_stochastic_alpha(packet, k, alpha_sample[min(p, alpha_sample.shape[0] - 1)])
        for axis in range(3):
            frame[0, axis, k], frame[1, axis, k], frame[2, axis, k] = t[axis], b[axis], n[axis]
        for row in range(3):
            local_wo[row, k] = frame[row, 0, k] * o[0] + frame[row, 1, k] * o[1] + frame[row, 2, k] * o[2]
        cosine_offset, glossy_offset = lattice_offsets(pattern, seed[p])
        for m in range(4):
            offsets[0, m, k], offsets[1, m, k] = cosine_offset[m], glossy_offset[m]


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _aim(pattern, ray, frame, local_wo, offsets, packet, width):  # type: ignore[no-untyped-def]
    """Generate the same ray of all lanes; return the number of rays above their horizon."""
    pattern_ray, is_cosine = pattern.rays[ray], ray < pattern.num_cosine
    cosine, glossy = offsets[0], offsets[1]
    num_valid = 0
    for k in range(LANES):
        if is_cosine:
            x, y, z = cosine_ray(pattern_ray, (cosine[0, k], cosine[1, k], cosine[2, k], cosine[3, k]))
        else:
            offset = (glossy[0, k], glossy[1, k], glossy[2, k], glossy[3, k])
            x, y, z = glossy_ray(pattern_ray, offset, local_wo[0, k], local_wo[1, k], local_wo[2, k])
        dx = frame[0, 0, k] * x + frame[1, 0, k] * y + frame[2, 0, k] * z
        dy = frame[0, 1, k] * x + frame[1, 1, k] * y + frame[2, 1, k] * z
        dz = frame[0, 2, k] * x + frame[1, 2, k] * y + frame[2, 2, k] * z
        set_direction(packet, k, dx, dy, dz, np.float32(np.inf))
        is_above = z > 0 and k < width
        enable_lane(packet, k, is_above)
        num_valid += is_above
    return num_valid


@nb.njit(nogil=True, cache=True, fastmath=True, forceinline=True, **NO_REFCOUNT)
def _hits_own_face(packet, lane, normals, offset):  # type: ignore[no-untyped-def]
    """Return whether a ray hits the triangle on which it starts.

    A direction above a smooth normal may lie below the plane of the triangle: the solid blocks it, as it blocks shadow
    rays, and diffuse light must not come from the triangle itself. Glossy and lobe rays do bring its light: it stands
    for further reflections, without which bumps in metal would be black.

    Args:
        packet: traced rays. lane: of the ray. normals: of the faces. offset: of ray origins on the faces, meters.
    """
    face, distance = get_hit(packet, lane)
    if face < 0:
        return False
    facing = np.float32(0)
    for axis in range(3):
        facing += normals[face, axis] * get_direction(packet, lane, axis)
    return abs(facing) * distance <= _MAX_HEIGHT * offset[face]


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def find_sides(packet, surfaces, roots, keys, nodes):  # type: ignore[no-untyped-def]
    """Find the side of a mesh that the ray of each lane hits.

    Args:
        packet: traced rays. surfaces: normal, and index of the front side, of each face. roots: of `PatchTree`.
        keys: position and normal of each hit, written. (6, `LANES`) float32
        nodes: root of each side, `NO_PATCH_NODE` for no hit, written. (`LANES`,) int32
    """
    normals, sides = surfaces
    for k in range(LANES):
        nodes[k] = NO_PATCH_NODE
        face, _ = get_hit(packet, k)
        if face < 0:
            continue
        facing = np.float32(0)
        for axis in range(3):
            keys[axis, k] = get_position(packet, k, axis)
            keys[3 + axis, k] = normals[face, axis]
            facing += normals[face, axis] * get_direction(packet, k, axis)
        is_back_face = facing > 0
        nodes[k] = roots[sides[face] + is_back_face]
        if is_back_face:
            for axis in range(3, 6):
                keys[axis, k] = -keys[axis, k]


@nb.njit(nogil=True, cache=True)
def _trace(tracer, points, wo, surfaces, tree, pattern, start, stop, gather_hits):  # type: ignore[no-untyped-def]
    """Trace all rays of points [start, stop), the same ray of `LANES` points at once; return their number.

    surfaces: normal, index of the front side, and offset of ray origins of each face.
    """
    packet, (normals, sides, offset) = new_packet(tracer), surfaces
    frame, local_wo = np.empty((3, 3, LANES), np.float32), np.empty((3, LANES), np.float32)
    offsets, keys = np.empty((2, 4, LANES), np.float32), np.zeros((6, LANES), np.float32)
    patches = np.empty(LANES, np.int32)
    num_rays = 0
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        _load_points(points, wo, pattern, first, width, packet, frame, local_wo, offsets)
        for ray in range(gather_hits.shape[1]):
            num_rays += _aim(pattern, ray, frame, local_wo, offsets, packet, width)
            trace_hits(packet)
            find_sides(packet, (normals, sides), tree.roots, keys, patches)
            locate(tree, keys, patches)
            for k in range(width):
                is_own = ray < pattern.num_cosine and _hits_own_face(packet, k, normals, offset)
                gather_hits[first + k, ray] = NO_PATCH if is_own else patches[k]
    return num_rays


def trace_gather_rays(
    geometry: SceneBuffers, tree: PatchTree, points: SurfacePoints, wo: Shaped[F32, "n 3"], pattern: RayPattern
) -> GatherHits:
    """Trace all gather rays of points. O(n · rays · (log triangles + log patches)) time.

    Args:
        geometry: the scene's triangles. tree: kd-tree of the patches.
        points: ray origins; their seeds shift the pattern.
        wo: view directions, unit, world space; glossy rays are distributed about their mirror direction.
        pattern: ray directions of every point.
    """
    gather_hits = np.empty((points.num_points, pattern.num_rays), np.uint16)
    surfaces = geometry.face_normals, (2 * geometry.face_mesh).astype(np.int32), geometry.origins.offset
    tracer = geometry.embree.hit_tracer(coherent=len(geometry.faces) <= _MAX_COHERENT_TRIANGLES)
    args = tracer, points, wo, surfaces, tree, pattern
    counts: list[int] = []

    def kernel(start: int, stop: int) -> None:
        counts.append(_trace(*args, start, stop, gather_hits))

    start_time = time.perf_counter()
    for_ranges(kernel, len(gather_hits), _POINTS_PER_RANGE)
    return GatherHits(gather_hits, sum(counts), time.perf_counter() - start_time)
