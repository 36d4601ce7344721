"""Paths of lobe rays that go on from surfaces with narrow lobes.

A ray that meets such a surface follows one direction of its lobe, up to four times: what chrome shows is not the
light of a patch. The lobe's energy is its directional albedo, its shape is sampled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.lobe_directions import angle_at_quantile, lobe_direction, ray_jitter
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    get_direction,
    get_hit,
    get_position,
    get_uv,
    set_direction,
    set_origin,
    trace_hits,
)
from relume.transport.patch_lookup import locate_smoothly, tangents_of

F32 = NDArray[np.float32]

MAX_REFLECTIONS = 4
END, ESCAPE, REFLECTION = np.uint8(0), np.uint8(1), np.uint8(2)
"""Kinds of entries in `LobePaths`."""

_HALF, _ONE = np.float32(0.5), np.float32(1)


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


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _store(paths, entry, point, ray, kind, patch, lanes, k, direction):  # type: ignore[no-untyped-def]
    """Write an entry of paths, with the point in `first`; its throughput, lobe and normal are those of lane k."""
    paths.first[entry], paths.ray[entry], paths.kind[entry], paths.patch[entry] = point, ray, kind, patch
    paths.lobe[entry] = lanes.lobe[k]
    for axis in range(3):
        paths.throughput[entry, axis], paths.normal[entry, axis] = lanes.throughput[axis, k], lanes.normal[axis, k]
        paths.direction[entry, axis] = direction[axis]


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def follow(packet, ray, num_rays, first, width, lookup, surfaces, lanes, paths, end):  # type: ignore[no-untyped-def]
    """Follow the rays of all lanes that hit a narrow lobe, and store their ends.

    Args:
        packet: traced rays. ray: their index. num_rays: rays of a point. first, width: points of the lanes.
        lookup, surfaces: `PatchLookup`, `LobeSurfaces`. lanes: `RayLanes`, with the patches of the traced rays.
        paths: `LobePaths`, written, with the point of each path in `first`. end: number of paths so far.
    Returns:
        New number of paths.
    """
    seeds, _, _, patches, last, lobes, throughput, normal, has_escaped = lanes
    for k in range(LANES):
        lobes[k], has_escaped[k], last[k] = -1, False, patches[k]
        throughput[0, k] = throughput[1, k] = throughput[2, k] = _ONE
    for depth in range(1, MAX_REFLECTIONS + 1):
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
        locate_smoothly(packet, ray, lookup, lanes)
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
