"""Lobe rays, hits: what each ray of a sample's lobe meets, the environment or a patch.

A ray that meets a surface with a narrow lobe of its own goes on along one direction of that lobe, up to four times:
what is seen in chrome is not the light of a patch. The lobe's energy is its directional albedo, its shape is sampled.
"""

from __future__ import annotations

import math
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
from relume.raytrace.lobe_directions import (
    LobePattern,
    angle_at_quantile,
    lobe_direction,
    lobe_ray,
    lobe_shift,
    ray_jitter,
)
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    enable_stochastic_alpha,
    get_direction,
    get_hit,
    get_position,
    get_uv,
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
_HALF, _ONE, _TWO = np.float32(0.5), np.float32(1), np.float32(2)
_MAX_REFLECTIONS = 4
END, ESCAPE, REFLECTION = np.uint8(0), np.uint8(1), np.uint8(2)
"""Kinds of entries in `LobePaths`."""

_PIXEL_SEED = np.uint32(0x5BD1E995)
_MIN_COSINE = np.float32(1e-3)
_HALF_WIDTH = 1.25  # of a square, by the spread of uniform points in it


class LobePaths(NamedTuple):
    """Lobe rays that went on from surfaces with narrow lobes: where they reflect and end, point by point, ray by ray.

    Attributes:
        first: begin of each point's entries. ray: index of the ray.
        kind: `END`, `ESCAPE` or `REFLECTION`. The last is stored for wide lobes, which the peaks of the environment
            light directly.
        patch: patch of the end or reflection, `NO_PATCH` for none. lobe: row in `LobeSurfaces` of the newest lobe.
        throughput: product of the albedos so far. direction: of the newest ray; of a reflection its wo, world space.
        normal: of a reflection.
    """

    first: Shaped[NDArray[np.int64], " ends"]
    ray: Shaped[NDArray[np.uint16], " K"]
    kind: Shaped[NDArray[np.uint8], " K"]
    patch: Shaped[NDArray[np.uint16], " K"]
    lobe: Shaped[NDArray[np.uint8], " K"]
    throughput: Shaped[F32, "K 3"]
    direction: Shaped[F32, "K 3"]
    normal: Shaped[F32, "K 3"]

    @classmethod
    def allocate(cls, num_points: int, num_entries: int) -> LobePaths:
        """Allocate memory for entries."""
        (ray, patch), (kind, lobe) = np.empty((2, num_entries), np.uint16), np.empty((2, num_entries), np.uint8)
        vectors = np.empty((3, num_entries, 3), np.float32)
        return cls(np.zeros(num_points + 1, np.int64), ray, kind, patch, lobe, *vectors)

    def rows(self, rows: Shaped[NDArray[np.integer], " m"]) -> LobePaths:
        """Select the paths of some points."""
        count = np.diff(self.first)[rows]
        first = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        index = np.arange(first[-1]) + np.repeat(self.first[:-1][rows] - first[:-1], count)
        return LobePaths(first, *(array[index] for array in self[1:]))


def no_paths(num_points: int) -> LobePaths:
    """Return the paths of rays that meet no narrow lobe."""
    return LobePaths.allocate(num_points, 0)


class _Lanes(NamedTuple):
    """State of the rays of all lanes.

    Attributes:
        seeds: of the points. keys: position and normal of each hit, moved by `_jitter`. roots: of its side.
        patches: of the newest hits. last: patch of each path's end. lobe: its newest lobe, −1 before one is met.
        throughput: as in `LobePaths`. normal: of the newest reflection. has_escaped: whether the ray left the scene.
    """

    seeds: Shaped[NDArray[np.uint32], " lanes"]
    keys: Shaped[F32, "6 lanes"]
    roots: Shaped[NDArray[np.int32], " lanes"]
    patches: Shaped[NDArray[np.int32], " lanes"]
    last: Shaped[NDArray[np.int32], " lanes"]
    lobe: Shaped[NDArray[np.int32], " lanes"]
    throughput: Shaped[F32, "3 lanes"]
    normal: Shaped[F32, "3 lanes"]
    has_escaped: Shaped[NDArray[np.bool_], " lanes"]


@nb.njit(nogil=True, cache=True)
def _allocate_lanes():  # type: ignore[no-untyped-def]
    return _Lanes(
        np.zeros(LANES, np.uint32), np.zeros((6, LANES), np.float32), np.zeros(LANES, np.int32),
        np.zeros(LANES, np.int32), np.zeros(LANES, np.int32), np.zeros(LANES, np.int32),
        np.zeros((3, LANES), np.float32), np.zeros((3, LANES), np.float32), np.zeros(LANES, np.bool_),
    )  # fmt: skip


class LobeSurfaces(NamedTuple):
    """Surfaces from which lobe rays go on.

    Attributes:
        faces: corners of the triangles. face_material: their materials.
        normals: of the corners; empty if only those of the triangles are known.
        lobe: row of each material in the following arrays, −1 if rays end there.
        quantile, band_density, is_half_angle, scale: as in `LobePattern`, at one level.
        albedo: directional albedo at equal steps of cos θo from 0 to 1.
        blur: angle over which the environment is averaged behind a wide lobe, radians; zero for others.
        tint: mean of the specular texture of each patch; ones in row `NO_PATCH`.
        offset: of ray origins from surfaces, meters.
    """

    faces: Shaped[NDArray[np.uint32], "faces 3"]
    face_material: Shaped[NDArray[np.int32], " faces"]
    normals: Shaped[F32, "corners 3"]
    lobe: Shaped[NDArray[np.int32], " materials"]
    quantile: Shaped[F32, "S quantiles"]
    band_density: Shaped[F32, "S bands"]
    is_half_angle: Shaped[NDArray[np.bool_], " S"]
    scale: Shaped[F32, " S"]
    albedo: Shaped[F32, "S steps 3"]
    blur: Shaped[F32, " S"]
    tint: Shaped[F32, "patches 3"]
    offset: float


NO_SURFACES = LobeSurfaces(
    faces=np.empty((0, 3), np.uint32),
    face_material=np.empty(0, np.int32),
    normals=np.empty((0, 3), np.float32),
    lobe=np.empty(0, np.int32),
    quantile=np.empty((0, 0), np.float32),
    band_density=np.empty((0, 0), np.float32),
    is_half_angle=np.empty(0, np.bool_),
    scale=np.empty(0, np.float32),
    albedo=np.empty((0, 0, 3), np.float32),
    blur=np.empty(0, np.float32),
    tint=np.empty((0, 3), np.float32),
    offset=0.0,
)
"""Of a scene in which all rays end at the first surface."""


@dataclass(frozen=True)
class LobeHits:
    """Hits of the lobe rays of n points.

    Attributes:
        patch: index of the patch that each ray hits, `NO_PATCH` for none.
        escapes: ray k of a point in bit k & 7 of byte k >> 3, set if it leaves the scene.
        paths: the rays that go on from narrow lobes.
    """

    patch: Shaped[NDArray[np.uint16], "n rays"]
    escapes: Shaped[NDArray[np.uint8], "n bytes"]
    paths: LobePaths

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.patch.nbytes + self.escapes.nbytes + sum(array.nbytes for array in self.paths)

    def rows(self, rows: Shaped[NDArray[np.integer], " m"]) -> LobeHits:
        """Select points."""
        return LobeHits(self.patch[rows], self.escapes[rows], self.paths.rows(rows))


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


NO_FOOTPRINT = np.zeros((1, 2, 2, 3), np.float32)
"""Of points without an extent."""


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def lobe_ray_in_pixel(pattern, level, ray, shift, normal, tangent, wo, footprint, seed):  # type: ignore[no-untyped-def]
    """World-space direction of a ray from somewhere within its point's part of a pixel.

    Args:
        pattern, level, ray, shift: as in `lobe_ray`. normal, tangent, wo: of the point. footprint: of the point.
        seed: of the point.
    Returns:
        The direction, a tuple; True if the ray is above the horizon and must be traced.
    """
    u, v = ray_jitter(ray, np.uint32(seed) ^ _PIXEL_SEED)
    u, v = u - _HALF, v - _HALF
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
    (x, y, z), band = lobe_ray(pattern, level, ray, shift, local[0], local[1], max(local[2], _MIN_COSINE))
    d = t[0] * x + b[0] * y + nx * z, t[1] * x + b[1] * y + ny * z, t[2] * x + b[2] * y + nz * z
    return d, z > 0 and band >= 0 and d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2] > 0


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _load_points(points, first, width, packet):  # type: ignore[no-untyped-def]
    """Load points [first, first + width) into the lanes of a packet."""
    for k in range(LANES):
        p = first + min(k, width - 1)
        set_origin(packet, k, points.position[p, 0], points.position[p, 1], points.position[p, 2])
        enable_stochastic_alpha(packet, k, points.alpha_sample[min(p, points.alpha_sample.shape[0] - 1)])


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _aim(pattern, ray, points, wo, footprint, levels, shifts, first, width, packet):  # type: ignore[no-untyped-def]
    """Aim the same ray of all lanes; return the number of rays above their horizon. See `_trace`."""
    num_valid = 0
    for k in range(LANES):
        p = first + min(k, width - 1)
        (dx, dy, dz), is_above = lobe_ray_in_pixel(
            pattern, levels[k], ray, (shifts[0, k], shifts[1, k]), points.normal[p], points.tangent[p], wo[p],
            footprint[min(p, footprint.shape[0] - 1)], points.seed[p],
        )  # fmt: skip
        set_direction(packet, k, dx, dy, dz, np.float32(np.inf))
        is_traced = is_above and k < width and pattern.is_narrow[levels[k]]
        enable_lane(packet, k, is_traced)
        num_valid += is_traced
    return num_valid


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
def _normal_at_hit(packet, k, face, face_normal, surfaces):  # type: ignore[no-untyped-def]
    """Interpolated normal at a lane's hit, and the triangle's, both toward the ray's origin. Two tuples"""
    fx, fy, fz = face_normal[face, 0], face_normal[face, 1], face_normal[face, 2]
    dx, dy, dz = get_direction(packet, k, 0), get_direction(packet, k, 1), get_direction(packet, k, 2)
    side = -_ONE if fx * dx + fy * dy + fz * dz > 0 else _ONE
    fx, fy, fz = side * fx, side * fy, side * fz
    if surfaces.normals.shape[0] == 0:
        return (fx, fy, fz), (fx, fy, fz)
    u, v = get_uv(packet, k)
    a, b, c = surfaces.faces[face, 0], surfaces.faces[face, 1], surfaces.faces[face, 2]
    w = _ONE - u - v
    nx = side * (w * surfaces.normals[a, 0] + u * surfaces.normals[b, 0] + v * surfaces.normals[c, 0])
    ny = side * (w * surfaces.normals[a, 1] + u * surfaces.normals[b, 1] + v * surfaces.normals[c, 1])
    nz = side * (w * surfaces.normals[a, 2] + u * surfaces.normals[b, 2] + v * surfaces.normals[c, 2])
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < np.float32(1e-6) or nx * dx + ny * dy + nz * dz > 0:
        return (fx, fy, fz), (fx, fy, fz)
    return (nx / length, ny / length, nz / length), (fx, fy, fz)


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _reflect(packet, k, lobe, random, face_normal, surfaces, throughput, normal):  # type: ignore[no-untyped-def]
    """Aim a lane along the lobe of the surface that it hits; return False if the light is absorbed.

    Args:
        packet: its ray is replaced. k: the lane. lobe: row in `LobeSurfaces`. random: two numbers in [0, 1).
        face_normal: of all faces. surfaces: `LobeSurfaces`. throughput: multiplied by the albedo. (3, `LANES`)
        normal: of the surface, written. (3, `LANES`)
    """
    face, _ = get_hit(packet, k)
    n, f = _normal_at_hit(packet, k, face, face_normal, surfaces)
    t, b = tangents_of(n)
    normal[0, k], normal[1, k], normal[2, k] = n
    dx, dy, dz = get_direction(packet, k, 0), get_direction(packet, k, 1), get_direction(packet, k, 2)
    ox, oy = -(t[0] * dx + t[1] * dy + t[2] * dz), -(b[0] * dx + b[1] * dy + b[2] * dz)
    oz = min(max(-(n[0] * dx + n[1] * dy + n[2] * dz), np.float32(1e-4)), _ONE)
    step = oz * np.float32(surfaces.albedo.shape[1] - 1)
    cell = min(int(step), surfaces.albedo.shape[1] - 2)
    for channel in range(3):
        low, high = surfaces.albedo[lobe, cell, channel], surfaces.albedo[lobe, cell + 1, channel]
        throughput[channel, k] *= low + (step - np.float32(cell)) * (high - low)
    # its tail is left to the blur of what is seen there: it would be noise
    angle = angle_at_quantile(surfaces.quantile, lobe, _HALF * random[0])
    (x, y, z), is_valid = lobe_direction(surfaces.is_half_angle[lobe], angle, random[1], ox, oy, oz)
    wx, wy, wz = t[0] * x + b[0] * y + n[0] * z, t[1] * x + b[1] * y + n[1] * z, t[2] * x + b[2] * y + n[2] * z
    offset, facing = np.float32(surfaces.offset), f[0] * wx + f[1] * wy + f[2] * wz
    px, py, pz = get_position(packet, k, 0), get_position(packet, k, 1), get_position(packet, k, 2)
    set_origin(packet, k, px + offset * f[0], py + offset * f[1], pz + offset * f[2])
    set_direction(packet, k, wx, wy, wz, np.float32(np.inf))
    return is_valid and z > 0 and facing > 0


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _locate_smoothly(packet, ray, lookup, lanes):  # type: ignore[no-untyped-def]
    """Find the patches that the rays of all lanes hit, moved by `_jitter`."""
    tree, roots, patches = lookup.tree, lanes.roots, lanes.patches
    find_sides(packet, (lookup.normals, lookup.sides), tree.roots, lanes.keys, roots)
    for k in range(LANES):
        patches[k] = roots[k]
    locate(tree, lanes.keys, patches)
    _jitter(ray, lanes.seeds, lookup.reach, patches, lanes.keys)
    for k in range(LANES):
        patches[k] = roots[k]
    locate(tree, lanes.keys, patches)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _store(paths, entry, point, ray, kind, patch, lanes, k, direction):  # type: ignore[no-untyped-def]
    """Write an entry of paths, with the point in `first`; its throughput, lobe and normal are those of lane k."""
    paths.first[entry], paths.ray[entry], paths.kind[entry], paths.patch[entry] = point, ray, kind, patch
    paths.lobe[entry] = lanes.lobe[k]
    for axis in range(3):
        paths.throughput[entry, axis], paths.normal[entry, axis] = lanes.throughput[axis, k], lanes.normal[axis, k]
        paths.direction[entry, axis] = direction[axis]


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _follow(packet, ray, num_rays, first, width, lookup, surfaces, lanes, paths, end):  # type: ignore[no-untyped-def]
    """Follow the rays of all lanes that hit a narrow lobe, and store their ends.

    Args:
        packet: traced rays. ray: their index. num_rays: rays of a point. first, width: points of the lanes.
        lookup, surfaces: `PatchLookup`, `LobeSurfaces`. lanes: `_Lanes`, with the patches of the traced rays.
        paths: `LobePaths`, written, with the point of each path in `first`. end: number of paths so far.
    Returns:
        New number of paths.
    """
    seeds, _, _, patches, last, lobes, throughput, normal, has_escaped = lanes
    for k in range(LANES):
        lobes[k], has_escaped[k], last[k] = -1, False, patches[k]
        throughput[0, k] = throughput[1, k] = throughput[2, k] = _ONE
    for depth in range(1, _MAX_REFLECTIONS + 1):
        num_active = 0
        for k in range(LANES):
            face = get_hit(packet, k)[0] if packet.is_active[k] != 0 else np.int32(-1)
            lobe = surfaces.lobe[surfaces.face_material[face]] if face >= 0 else np.int32(-1)
            is_reflected = False
            if lobe >= 0:
                for channel in range(3):
                    throughput[channel, k] *= surfaces.tint[last[k], channel]
                random, patch = ray_jitter(ray + depth * num_rays, seeds[k]), last[k]
                view = -get_direction(packet, k, 0), -get_direction(packet, k, 1), -get_direction(packet, k, 2)
                is_reflected = _reflect(packet, k, lobe, random, lookup.normals, surfaces, throughput, normal)
                lobes[k], last[k] = lobe, NO_PATCH
                if surfaces.blur[lobe] > 0 and k < width:
                    _store(paths, end, first + k, ray, REFLECTION, patch, lanes, k, view)
                    end += 1
            enable_lane(packet, k, is_reflected)
            num_active += is_reflected
        if num_active == 0:
            break
        trace_hits(packet)
        _locate_smoothly(packet, ray, lookup, lanes)
        for k in range(LANES):
            if packet.is_active[k] != 0:
                last[k], has_escaped[k] = patches[k], get_hit(packet, k)[0] < 0
    for k in range(width):
        if lobes[k] >= 0:
            direction = get_direction(packet, k, 0), get_direction(packet, k, 1), get_direction(packet, k, 2)
            kind = ESCAPE if has_escaped[k] and last[k] == NO_PATCH else END
            _store(paths, end, first + k, ray, kind, last[k], lanes, k, direction)
            end += 1
    return end


@nb.njit(nogil=True, cache=True)
def _trace(tracer, points, wo, footprint, level, lookup, surfaces, pattern, start, stop, patch, escapes, paths):  # type: ignore[no-untyped-def]
    """Trace all rays of points [start, stop), the same ray of `LANES` points at once.

    Args:
        tracer: of closest hits. points: `SurfacePoints`. wo: view directions. footprint: as in `trace_lobe_rays`, or
            one. level: roughness levels, or one.
        lookup, surfaces: `PatchLookup`, `LobeSurfaces`. pattern: `LobePattern`.
        patch, escapes: of `LobeHits`, written; escapes are zero before. paths: see `_follow`.
    Returns:
        Number of paths.
    """
    packet, lanes, end = new_packet(tracer), _allocate_lanes(), 0
    shifts, levels = np.empty((2, LANES), np.float32), np.empty(LANES, np.int64)
    follows, num_rays = surfaces.quantile.shape[0] > 0, patch.shape[1]
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        for k in range(LANES):
            p = first + min(k, width - 1)
            levels[k], lanes.seeds[k] = level[min(p, level.shape[0] - 1)], points.seed[p]
            shifts[0, k], shifts[1, k] = lobe_shift(pattern, points.seed[p])
        _load_points(points, first, width, packet)
        for ray in range(num_rays):
            if _aim(pattern, ray, points, wo, footprint, levels, shifts, first, width, packet) == 0:
                continue
            trace_hits(packet)
            _locate_smoothly(packet, ray, lookup, lanes)
            for k in range(width):
                patch[first + k, ray] = lanes.patches[k]
                is_escaping = packet.is_active[k] != 0 and get_hit(packet, k)[0] < 0
                escapes[first + k, ray >> 3] |= is_escaping << (ray & 7)
            if follows:
                before = end
                end = _follow(packet, ray, num_rays, first, width, lookup, surfaces, lanes, paths, end)
                if end > before:
                    _load_points(points, first, width, packet)
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
        geometry: the scene's triangles. lookup: finds patches. surfaces: from which rays go on.
        points: ray origins; their seeds shift the pattern. wo: view directions, unit, world space.
        footprint: change of each point's normal and of its wo along the two sides of its part of a pixel, over which
            rays are spread; or `NO_FOOTPRINT`.
        level: roughness levels; None if all points have the same. pattern: rays of every point.
        is_canceled: polled.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    num_points, num_rays = points.num_points, pattern.num_rays
    patch = np.full((num_points, num_rays), NO_PATCH, np.uint16)
    escapes = np.zeros((num_points, -(-num_rays // 8)), np.uint8)
    levels = np.zeros(1, np.uint8) if level is None else level
    args = geometry.embree.hit_tracer(coherent=False), points, wo, footprint, levels, lookup, surfaces, pattern
    found: dict[int, LobePaths] = {}

    def kernel(start: int, stop: int) -> None:
        capacity = (stop - start) * num_rays * (1 + _MAX_REFLECTIONS) if len(surfaces.quantile) else 0
        paths = LobePaths.allocate(capacity - 1, capacity)
        num_paths = _trace(*args, start, stop, patch, escapes, paths)
        order = np.argsort(paths.first[:num_paths], kind="stable")
        found[start] = LobePaths._make(array[:num_paths][order] for array in paths)

    parallel_for_cancellable(kernel, num_points, _POINTS_PER_RANGE, lambda _: None, is_canceled, "tracing lobes")
    if not found:
        return LobeHits(patch, escapes, no_paths(num_points))
    point, *columns = (np.concatenate(arrays) for arrays in zip(*(found[k] for k in sorted(found)), strict=True))
    first = np.searchsorted(point, np.arange(num_points + 1)).astype(np.int64)
    return LobeHits(patch, escapes, LobePaths(first, *columns))
