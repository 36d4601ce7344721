"""Lobe rays, hits: what each ray of a sample's lobe meets, the environment or a patch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_cancellable
from relume.patches.gather_hits import find_sides
from relume.patches.patch_kdtree import NO_PATCH, PatchTree, locate
from relume.raytrace.lobe_directions import LobePattern, lobe_ray, lobe_shift, ray_jitter
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

F32 = NDArray[np.float32]

_POINTS_PER_RANGE = 256
_ONE, _TWO = np.float32(1), np.float32(2)
_HALF_WIDTH = 1.25  # of a square, by the spread of uniform points in it


@dataclass(frozen=True)
class LobeHits:
    """Hits of the lobe rays of n points.

    Attributes:
        patch: index of the patch that each ray hits, `NO_PATCH` for none.
        escapes: ray k of a point in bit k & 7 of byte k >> 3, set if it leaves the scene.
    """

    patch: Shaped[NDArray[np.uint16], "n rays"]
    escapes: Shaped[NDArray[np.uint8], "n bytes"]

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.patch.nbytes + self.escapes.nbytes


class PatchLookup(NamedTuple):
    """What finds the patch of a hit.

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


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _load_points(points, wo, first, width, packet, frames, local_wo):  # type: ignore[no-untyped-def]
    """Load points [first, first + width) into the lanes of a packet, with their local frames.

    Args:
        points: `SurfacePoints`. wo: view directions. (n, 3) packet: written.
        frames: tangent, bitangent and normal, written. (3, 3, `LANES`) local_wo: written. (3, `LANES`)
    """
    for k in range(LANES):
        p = first + min(k, width - 1)
        n, t = points.normal[p], points.tangent[p]
        b, o = in_frame(n, t, wo[p])
        set_origin(packet, k, points.position[p, 0], points.position[p, 1], points.position[p, 2])
        enable_stochastic_alpha(packet, k, points.alpha_sample[min(p, points.alpha_sample.shape[0] - 1)])
        for axis in range(3):
            frames[0, axis, k], frames[1, axis, k], frames[2, axis, k] = t[axis], b[axis], n[axis]
            local_wo[axis, k] = o[axis]


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _aim(pattern, ray, levels, shifts, frames, local_wo, width, packet):  # type: ignore[no-untyped-def]
    """Aim the same ray of all lanes; return the number of rays above their horizon."""
    num_valid = 0
    for k in range(LANES):
        shift = shifts[0, k], shifts[1, k]
        (x, y, z), band = lobe_ray(pattern, levels[k], ray, shift, local_wo[0, k], local_wo[1, k], local_wo[2, k])
        dx = frames[0, 0, k] * x + frames[1, 0, k] * y + frames[2, 0, k] * z
        dy = frames[0, 1, k] * x + frames[1, 1, k] * y + frames[2, 1, k] * z
        dz = frames[0, 2, k] * x + frames[1, 2, k] * y + frames[2, 2, k] * z
        set_direction(packet, k, dx, dy, dz, np.float32(np.inf))
        is_above = z > 0 and band >= 0 and k < width
        enable_lane(packet, k, is_above)
        num_valid += is_above
    return num_valid


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
        sign = _ONE if nz >= 0 else -_ONE  # orthonormal basis of Duff 2017
        a = -_ONE / (sign + nz)
        b = nx * ny * a
        keys[0, k] += u * (_ONE + sign * nx * nx * a) + v * b
        keys[1, k] += u * sign * b + v * (sign + ny * ny * a)
        keys[2, k] += -u * sign * nx - v * ny


@nb.njit(nogil=True, cache=True)
def _trace(tracer, points, wo, level, lookup, pattern, start, stop, patch, escapes):  # type: ignore[no-untyped-def]
    """Trace all rays of points [start, stop), the same ray of `LANES` points at once.

    Args:
        tracer: of closest hits. points: `SurfacePoints`. wo: view directions. level: roughness levels, or one.
        lookup: `PatchLookup`. pattern: `LobePattern`. patch, escapes: of `LobeHits`, written; escapes are zero before.
    """
    packet, surfaces, tree = new_packet(tracer), (lookup.normals, lookup.sides), lookup.tree
    frames, local_wo = np.empty((3, 3, LANES), np.float32), np.empty((3, LANES), np.float32)
    shifts, keys = np.empty((2, LANES), np.float32), np.zeros((6, LANES), np.float32)
    levels, seeds = np.empty(LANES, np.int64), np.empty(LANES, np.uint32)
    roots, patches = np.empty(LANES, np.int32), np.empty(LANES, np.int32)
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        _load_points(points, wo, first, width, packet, frames, local_wo)
        for k in range(LANES):
            p = first + min(k, width - 1)
            levels[k], seeds[k] = level[min(p, level.shape[0] - 1)], points.seed[p]
            shifts[0, k], shifts[1, k] = lobe_shift(pattern, seeds[k])
        for ray in range(patch.shape[1]):
            if _aim(pattern, ray, levels, shifts, frames, local_wo, width, packet) == 0:
                continue
            trace_hits(packet)
            find_sides(packet, surfaces, tree.roots, keys, roots)
            patches[:] = roots
            locate(tree, keys, patches)
            _jitter(ray, seeds, lookup.reach, patches, keys)
            locate(tree, keys, roots)
            for k in range(width):
                patch[first + k, ray] = roots[k]
                escapes[first + k, ray >> 3] |= (get_hit(packet, k)[0] < 0) << (ray & 7)


def trace_lobe_rays(
    geometry: SceneBuffers,
    lookup: PatchLookup,
    points: SurfacePoints,
    wo: Shaped[F32, "n 3"],
    level: Shaped[NDArray[np.uint8], " n"] | None,
    pattern: LobePattern,
    is_canceled: Callable[[], bool] = lambda: False,
) -> LobeHits:
    """Trace the lobe rays of points. O(n · rays · (log triangles + log patches)) time.

    Args:
        geometry: the scene's triangles. lookup: finds patches.
        points: ray origins; their seeds shift the pattern. wo: view directions, unit, world space.
        level: roughness levels; None if all points have the same. pattern: rays of every point.
        is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    num_points = points.num_points
    patch = np.full((num_points, pattern.num_rays), NO_PATCH, np.uint16)
    escapes = np.zeros((num_points, -(-pattern.num_rays // 8)), np.uint8)
    levels = np.zeros(1, np.uint8) if level is None else level
    args = geometry.embree.hit_tracer(coherent=False), points, wo, levels, lookup, pattern

    def kernel(start: int, stop: int) -> None:
        _trace(*args, start, stop, patch, escapes)

    parallel_for_cancellable(kernel, num_points, _POINTS_PER_RANGE, lambda _: None, is_canceled, "tracing lobes")
    return LobeHits(patch, escapes)
