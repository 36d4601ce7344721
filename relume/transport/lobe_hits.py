"""Lobe rays, hits: what each ray of a sample's lobe meets, the environment, a patch, or a polished surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_cancellable
from relume.patches.patch_kdtree import NO_PATCH, NO_PATCH_NODE
from relume.raytrace.lobe_directions import (
    LobePattern,
    angle_at_quantile,
    lobe_ray,
    lobe_shift,
    lobe_vector,
    ray_jitter,
)
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    enable_stochastic_alpha,
    get_hit,
    new_packet,
    set_direction,
    set_origin,
    trace_hits,
)
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.gather_kernel import in_frame
from relume.transport.lobe_paths import LobePaths, LobeSurfaces, follow, is_glass, look_up_hits, no_paths
from relume.transport.patch_lookup import PatchLookup, allocate_lanes

F32 = NDArray[np.float32]

_POINTS_PER_RANGE = 256
_PROBING, _FEW_PROBES = 4, 32  # every fourth ray is traced first, if there are enough
_FEW_RAYS = 8  # of a point: with fewer, ranges are longer, and their memory is allocated less often
_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_ROOT_TWO_PI = np.float32(math.sqrt(2 * math.pi))
_PIXEL_SEED, _ALPHA_SEED = np.uint32(0x5BD1E995), np.uint32(0x1B873593)
_LEAST_ALPHA = np.float32(2**-24)
_MIN_COSINE = np.float32(1e-3)


@dataclass(frozen=True)
class LobeHits:
    """Hits of the lobe rays of n points.

    Attributes:
        patch: index of the patch that each ray hits, `NO_PATCH` for none.
        escapes: ray k of a point in bit k & 7 of byte k >> 3, set if it leaves the scene; bits of no ray are undefined.
        texture: that each ray meets, packed, for each slot of `relume.transport.hit_textures.HitTextures`.
        paths: the rays that go on from narrow lobes or through glass; for the latter `patch` is `NO_PATCH`.
    """

    patch: Shaped[NDArray[np.uint16], "n rays"]
    escapes: Shaped[NDArray[np.uint8], "n bytes"]
    texture: Shaped[NDArray[np.uint32], "slots n rays"]
    paths: LobePaths

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        stored = self.patch, self.escapes, self.texture, *self.paths
        return sum(array.nbytes for array in stored)

    def rows(self, rows: Shaped[NDArray[np.integer], " m"]) -> LobeHits:
        """Select points."""
        return LobeHits(self.patch[rows], self.escapes[rows], self.texture[:, rows], self.paths.rows(rows))


NO_FOOTPRINT = np.zeros((1, 2, 2, 3), np.float32)
"""Of points without an extent."""


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def jittered_frame(normal, tangent, wo, footprint, u, v):  # type: ignore[no-untyped-def]
    """Shading frame of a point somewhere within its part of a pixel.

    Args:
        normal, tangent, wo: of the point. footprint: of the point. u, v: where, from −½ to ½.
    Returns:
        Tangent, bitangent and normal; the local wo there. Tuples.
    """
    nx = normal[0] + u * footprint[0, 0, 0] + v * footprint[0, 1, 0]
    ny = normal[1] + u * footprint[0, 0, 1] + v * footprint[0, 1, 1]
    nz = normal[2] + u * footprint[0, 0, 2] + v * footprint[0, 1, 2]
    scale = _ONE / math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx * scale, ny * scale, nz * scale
    ox = wo[0] + u * footprint[1, 0, 0] + v * footprint[1, 1, 0]
    oy = wo[1] + u * footprint[1, 0, 1] + v * footprint[1, 1, 1]
    oz = wo[2] + u * footprint[1, 0, 2] + v * footprint[1, 1, 2]
    scale = _ONE / math.sqrt(ox * ox + oy * oy + oz * oz)
    ox, oy, oz = ox * scale, oy * scale, oz * scale
    along = nx * tangent[0] + ny * tangent[1] + nz * tangent[2]
    tx, ty, tz = tangent[0] - along * nx, tangent[1] - along * ny, tangent[2] - along * nz
    scale = _ONE / math.sqrt(tx * tx + ty * ty + tz * tz)
    t = tx * scale, ty * scale, tz * scale
    b, local = in_frame((nx, ny, nz), t, (ox, oy, oz))
    return (t, b, (nx, ny, nz)), local


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def lobe_ray_in_pixel(pattern, vector, ray, normal, tangent, wo, footprint, seed):  # type: ignore[no-untyped-def]
    """World-space direction of a ray from somewhere within its point's part of a pixel.

    Args:
        pattern, vector: as in `lobe_ray`. ray: its index. normal, tangent, wo: of the point. footprint: of the point.
        seed: of the point.
    Returns:
        The direction, a tuple; True if the ray is above the horizon and must be traced.
    """
    u, v = ray_jitter(ray, np.uint32(seed) ^ _PIXEL_SEED)
    (t, b, n), local = jittered_frame(normal, tangent, wo, footprint, u - _HALF, v - _HALF)
    (x, y, z), is_valid = lobe_ray(pattern, vector, local[0], local[1], max(local[2], _MIN_COSINE))
    d = t[0] * x + b[0] * y + n[0] * z, t[1] * x + b[1] * y + n[1] * z, t[2] * x + b[2] * y + n[2] * z
    return d, z > 0 and is_valid and d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2] > 0


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _load_points(points, first, width, packet):  # type: ignore[no-untyped-def]
    """Load points [first, first + width) into the lanes of a packet."""
    for k in range(LANES):
        p = first + min(k, width - 1)
        set_origin(packet, k, points.position[p, 0], points.position[p, 1], points.position[p, 2])
        enable_stochastic_alpha(packet, k, points.alpha_sample[min(p, points.alpha_sample.shape[0] - 1)])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def half_vector_spread(footprint, p):  # type: ignore[no-untyped-def]
    """Angle by which half vectors change at most between the middle and a corner of a point's footprint, radians."""
    sides, total = footprint[min(p, footprint.shape[0] - 1)], _ZERO
    for axis in range(2):
        n, o = sides[0, axis], sides[1, axis]
        total += _HALF * np.float32(math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]))
        total += np.float32(0.25) * np.float32(math.sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2]))
    return total


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _ray_spacing(pattern, level, spread):  # type: ignore[no-untyped-def]
    """Angle between neighboring rays of a point, radians: their footprint at unit distance.

    Half of the rays are within the median of the lobe; all are spread over the pixel.

    Args:
        pattern, level: of the point. spread: from `half_vector_spread`.
    """
    median = angle_at_quantile(pattern.quantile, level * pattern.angles.shape[0], _HALF)
    radius = _TWO * median if pattern.is_half_angle else median
    return (_ROOT_TWO_PI * radius + _TWO * spread) / np.float32(math.sqrt(pattern.uv.shape[0]))


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _aim(pattern, ray, points, wo, footprint, levels, shifts, first, width, has_glass, packet):  # type: ignore[no-untyped-def]
    """Aim the same ray of all lanes; return the number of rays above their horizon. See `_trace`.

    Rays stop at all glass of a scene, and are not split by tints: their paths have three channels.
    """
    num_valid = 0
    for k in range(LANES):
        p = first + min(k, width - 1)
        vector, _ = lobe_vector(pattern, levels[k], ray, (shifts[0, k], shifts[1, k]))
        (dx, dy, dz), is_above = lobe_ray_in_pixel(
            pattern, vector, ray, points.normal[p], points.tangent[p], wo[p],
            footprint[min(p, footprint.shape[0] - 1)], points.seed[p],
        )  # fmt: skip
        set_direction(packet, k, dx, dy, dz, np.float32(np.inf))
        if has_glass:
            enable_stochastic_alpha(packet, k, max(ray_jitter(ray, points.seed[p] ^ _ALPHA_SEED)[0], _LEAST_ALPHA))
        is_traced = is_above and k < width and pattern.is_narrow[levels[k]]
        enable_lane(packet, k, is_traced)
        num_valid += is_traced
    return num_valid


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _store_hits(packet, lanes, ray, first, width, surfaces, hits):  # type: ignore[no-untyped-def]
    """Store what a ray of points [first, first + width) meets; return how many of them escape. See `_trace_packet`."""
    (patch, escapes, texture), num_escaping = hits, 0
    for k in range(width):
        face = get_hit(packet, k)[0]
        is_escaping = packet.is_active[k] != 0 and face < 0
        num_escaping += is_escaping
        escapes[first + k, ray >> 3] |= is_escaping << (ray & 7)
        for row in range(texture.shape[0]):
            texture[row, first + k, ray] = lanes.texture[row, k]
        passes_glass = packet.is_active[k] != 0 and face >= 0 and is_glass(surfaces, face)
        patch[first + k, ray] = NO_PATCH if passes_glass else lanes.patches[k]
    return num_escaping


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _trace_packet(packet, lanes, aim, points, wo, footprint, lookup, surfaces, pattern, first, width, hits, paths, end):  # type: ignore[no-untyped-def]
    """Trace all rays of points [first, first + width), the same ray of all at once.

    Every fourth ray comes first. If all of these above the horizon, of all points, escape, all others are taken to
    escape too: an occluder between them covers a small part of the lobes. If none escapes, and it does not matter what
    they meet, all others are taken not to escape.

    Args:
        packet, lanes: memory. aim: shift and level of each lane, and `_is_lit`.
        points, wo, footprint, lookup, surfaces, pattern, hits, paths: as in `_trace`. end: number of paths so far.
    Returns:
        New number of paths.
    """
    (shifts, levels, is_lit), num_rays = aim, hits[0].shape[1]
    has_glass = surfaces.glass.shape[0] > 0
    follows = surfaces.quantile.shape[0] > 0 or has_glass
    _load_points(points, first, width, packet)
    num_probes = num_escaping = 0  # of the rays above their horizons
    for begin in range(_PROBING):
        if begin == 1 and num_rays >= _FEW_PROBES and num_probes > 0:
            if num_escaping == num_probes:
                hits[1][first : first + width] = 255
            if num_escaping == num_probes or (num_escaping == 0 and not is_lit):
                break
        for ray in range(begin, num_rays, _PROBING):
            num_valid = _aim(pattern, ray, points, wo, footprint, levels, shifts, first, width, has_glass, packet)
            if num_valid == 0:
                continue
            num_probes += num_valid if begin == 0 else 0
            trace_hits(packet)
            if is_lit:
                for k in range(LANES):
                    lanes.distance[k] = 0
                look_up_hits(packet, ray, lookup, surfaces, lanes)
            num_escaping += _store_hits(packet, lanes, ray, first, width, surfaces, hits)
            if follows:
                before = end
                end = follow(packet, ray, num_rays, first, width, lookup, surfaces, lanes, paths, end)
                if end > before:
                    _load_points(points, first, width, packet)
    return end


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _is_lit(lookup, surfaces):  # type: ignore[no-untyped-def]
    """True if rays that meet a surface may bring light: of a patch, of a lobe or through glass."""
    is_lit = surfaces.quantile.shape[0] > 0 or surfaces.glass.shape[0] > 0
    for k in range(lookup.tree.roots.shape[0]):
        is_lit |= lookup.tree.roots[k] != NO_PATCH_NODE
    return is_lit


@nb.njit(nogil=True, cache=True)
def _trace(tracer, points, wo, footprint, level, lookup, surfaces, pattern, start, stop, hits, paths):  # type: ignore[no-untyped-def]
    """Trace all rays of points [start, stop), the same ray of `LANES` points at once.

    Args:
        tracer: of closest hits. points: `SurfacePoints`. wo: view directions. footprint: as in `trace_lobe_rays`, or
            one. level: roughness levels, or one.
        lookup, surfaces: `PatchLookup`, `LobeSurfaces`. pattern: `LobePattern`.
        hits: patch, escapes and texture of `LobeHits`, written; escapes are zero before. paths: see `follow`.
    Returns:
        Number of paths.
    """
    packet, lanes, end = new_packet(tracer), allocate_lanes(), np.int64(0)
    shifts, levels = np.empty((2, LANES), np.float32), np.empty(LANES, np.int64)
    is_lit = _is_lit(lookup, surfaces)
    lanes.patches[:] = NO_PATCH  # stays so in direct light, where hits are not looked up
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        for k in range(LANES):
            p = first + min(k, width - 1)
            levels[k], lanes.seeds[k] = level[min(p, level.shape[0] - 1)], points.seed[p]
            shifts[0, k], shifts[1, k] = lobe_shift(pattern, points.seed[p])
            lanes.spread[k] = _ray_spacing(pattern, levels[k], half_vector_spread(footprint, p))
        end = _trace_packet(
            packet, lanes, (shifts, levels, is_lit), points, wo, footprint, lookup, surfaces, pattern, first, width,
            hits, paths, end,
        )  # fmt: skip
    return end


def trace_lobe_rays(
    geometry: SceneBuffers,
    lookup: PatchLookup,
    surfaces: LobeSurfaces,
    points: SurfacePoints,
    wo: Shaped[F32, "n 3"],
    footprint: Shaped[F32, "#n 2 2 3"],
    level: Shaped[NDArray[np.uint8], " n"] | None,
    pattern: LobePattern,
    is_canceled: Callable[[], bool] = lambda: False,
) -> LobeHits:
    """Trace the lobe rays of points. O(n · rays · (log triangles + log patches)) time.

    Args:
        geometry: the scene's triangles. lookup: finds patches. surfaces: that rays meet.
        points: ray origins; their seeds shift the pattern. wo: view directions, unit, world space.
        footprint: change of each point's normal and of its wo along the two sides of its part of a pixel, over which
            rays are spread; or `NO_FOOTPRINT`.
        level: roughness levels; None if all points have the same. pattern: rays of every point.
        is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    num_points, num_rays, num_slots = points.num_points, pattern.num_rays, len(surfaces.textures.slots)
    patch = np.full((num_points, num_rays), NO_PATCH, np.uint16)
    escapes = np.zeros((num_points, -(-num_rays // 8)), np.uint8)
    texture = np.zeros((num_slots, num_points, num_rays), np.uint32)
    levels = np.zeros(1, np.uint8) if level is None else level
    args = geometry.embree.hit_tracer(coherent=True), points, wo, footprint, levels, lookup, surfaces, pattern
    found: dict[int, LobePaths] = {}

    def kernel(start: int, stop: int) -> None:
        capacity = (stop - start) * num_rays * surfaces.max_entries
        paths = LobePaths.allocate(capacity - 1, capacity, num_slots)
        num_paths = _trace(*args, start, stop, (patch, escapes, texture), paths)
        order = np.lexsort((paths.ray[:num_paths], paths.first[:num_paths]))
        found[start] = LobePaths._make(array[:num_paths][order] for array in paths)

    num_in_range = _POINTS_PER_RANGE * max(_FEW_RAYS // num_rays, 1)
    parallel_for_cancellable(kernel, num_points, num_in_range, lambda _: None, is_canceled, "tracing lobes")
    if not found:
        return LobeHits(patch, escapes, texture, no_paths(num_points, num_slots))
    point, *columns = (np.concatenate(arrays) for arrays in zip(*(found[k] for k in sorted(found)), strict=True))
    first = np.searchsorted(point, np.arange(num_points + 1)).astype(np.int64)
    return LobeHits(patch, escapes, texture, LobePaths(first, *columns))
