"""Paths of lobe rays that go on from surfaces with narrow lobes, and through glass.

A ray that meets a narrow lobe follows one direction of it, up to four times: what chrome shows is not the light of a
patch. The lobe's energy is its directional albedo, its shape is sampled. Glass adds what it reflects itself, and passes
the ray with the transmittance of each channel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.math.rgb9e5 import unpack_rgb9e5
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.lobe_directions import angle_at_quantile, lobe_direction, ray_jitter
from relume.raytrace.ray_origins import NO_ORIGINS, OriginMesh, ray_origin
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    get_direction,
    get_hit,
    get_uv,
    set_direction,
    set_origin,
    trace_hits,
)
from relume.transport.hit_textures import NO_TEXTURES, HitTextures, emission_image, look_up_textures
from relume.transport.patch_lookup import locate_smoothly, tangents_of

F32 = NDArray[np.float32]

MAX_REFLECTIONS = 4
_MAX_SIDES = 8  # of glass
NO_EMITTER = np.uint16(65535)
END, ESCAPE, REFLECTION, TRANSMISSION = np.uint8(0), np.uint8(1), np.uint8(2), np.uint8(3)
"""Kinds of entries in `LobePaths`."""

_HALF, _ONE = np.float32(0.5), np.float32(1)
_SHORTEST = 1e-30  # edge, meters


class LobePaths(NamedTuple):
    """Lobe rays that went on from narrow lobes or through glass, point by point, ray by ray.

    Attributes:
        first: begin of each point's entries. ray: index of the ray.
        kind: `END` at a patch, also for the light that glass on the path reflects itself; `ESCAPE` from the scene,
            `TRANSMISSION` if through glass alone; or `REFLECTION`, stored for lobes with a blur, which the brightest
            parts of the environment light directly.
        patch: patch of the end or reflection, `NO_PATCH` for none. lobe: row in `LobeSurfaces` of the newest lobe.
        face: triangle of that lobe, −1 before any.
        texture: at the end, see `relume.transport.hit_textures`.
        emitter: material of the end if it may emit light to this side after a reflection, else `NO_EMITTER`: the
            samples of local lights are the light before any. emission: its image there, packed.
        throughput: product of the albedos and transmittances so far.
        direction: of the newest ray; of a reflection its wo, world space.
        normal: of a reflection.
        spread: angle between the mirror directions of neighboring rays at a reflection, radians.
    """

    first: Shaped[NDArray[np.int64], " ends"]
    ray: Shaped[NDArray[np.uint16], " K"]
    kind: Shaped[NDArray[np.uint8], " K"]
    patch: Shaped[NDArray[np.uint16], " K"]
    lobe: Shaped[NDArray[np.uint8], " K"]
    face: Shaped[NDArray[np.int32], " K"]
    texture: Shaped[NDArray[np.uint32], "K slots"]
    emitter: Shaped[NDArray[np.uint16], " K"]
    emission: Shaped[NDArray[np.uint32], " K"]
    throughput: Shaped[F32, "K 3"]
    direction: Shaped[F32, "K 3"]
    normal: Shaped[F32, "K 3"]
    spread: Shaped[F32, " K"]

    @classmethod
    def allocate(cls, num_points: int, num_entries: int, num_slots: int) -> LobePaths:
        """Allocate memory for entries.

        Args:
            num_points: points of the paths. num_entries: entries. num_slots: textures of each.
        """
        (ray, patch, emitter), (kind, lobe) = (
            np.empty((3, num_entries), np.uint16),
            np.empty((2, num_entries), np.uint8),
        )
        vectors = np.empty((3, num_entries, 3), np.float32)
        texture, emission = np.empty((num_entries, num_slots), np.uint32), np.empty(num_entries, np.uint32)
        first, spread = np.zeros(num_points + 1, np.int64), np.empty(num_entries, np.float32)
        face, (throughput, direction, normal) = np.empty(num_entries, np.int32), vectors
        return cls(
            first, ray, kind, patch, lobe, face, texture, emitter, emission, throughput, direction, normal, spread
        )

    def rows(self, rows: Shaped[NDArray[np.integer], " m"]) -> LobePaths:
        """Select the paths of some points."""
        count = np.diff(self.first)[rows]
        first = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        index = np.arange(first[-1]) + np.repeat(self.first[:-1][rows] - first[:-1], count)
        return LobePaths(first, *(array[index] for array in self[1:]))


def no_paths(num_points: int, num_slots: int = 0) -> LobePaths:
    """Return the paths of rays that meet neither a narrow lobe nor glass."""
    return LobePaths.allocate(num_points, 0, num_slots)


class LobeSurfaces(NamedTuple):
    """Surfaces that lobe rays meet, and from which they go on.

    Attributes:
        face_material: materials of the triangles.
        normals: of the corners; empty if only those of the triangles are known.
        curvature: largest change of the normal along an edge of each triangle, per meter.
        lobe: row of each material in the following arrays, −1 if rays end there.
        quantile, band_density, is_half_angle, scale: as in `LobePattern`, at one level.
        albedo: directional albedo at equal steps of cos θo from 0 to 1.
        blur: angle over which the environment is averaged behind a wide lobe, radians; zero for others. See
            `LobePaths.kind`.
        tint: mean of the specular texture of each patch, for a store without textures; ones in row `NO_PATCH`.
        textures: of all surfaces. specular: row of the specular texture among those of a hit, −1 for none.
        glass: transmittance of each material for red, green and blue without reflectance, −1 if it is opaque, and the
            reflectance at normal incidence; no rows for a scene without glass.
        is_two_sided: of each material, whether it emits to both sides.
        origins: the triangles, as origins of rays.
    """

    face_material: Shaped[NDArray[np.int32], " faces"]
    normals: Shaped[F32, "corners 3"]
    curvature: Shaped[F32, " faces"]
    lobe: Shaped[NDArray[np.int32], " materials"]
    quantile: Shaped[F32, "S quantiles"]
    band_density: Shaped[F32, "S bands"]
    is_half_angle: Shaped[NDArray[np.bool_], " S"]
    scale: Shaped[F32, " S"]
    albedo: Shaped[F32, "S steps 3"]
    blur: Shaped[F32, " S"]
    tint: Shaped[F32, "patches 3"]
    textures: HitTextures
    specular: int
    glass: Shaped[F32, "materials 4"]
    is_two_sided: Shaped[NDArray[np.bool_], " materials"]
    origins: OriginMesh

    @property
    def max_entries(self) -> int:
        """Largest number of entries of a ray in `LobePaths`."""
        return MAX_REFLECTIONS + _MAX_SIDES + 1 if len(self.quantile) or len(self.glass) else 0


NO_SURFACES = LobeSurfaces(
    face_material=np.empty(0, np.int32),
    normals=np.empty((0, 3), np.float32),
    curvature=np.empty(0, np.float32),
    lobe=np.empty(0, np.int32),
    quantile=np.empty((0, 0), np.float32),
    band_density=np.empty((0, 0), np.float32),
    is_half_angle=np.empty(0, np.bool_),
    scale=np.empty(0, np.float32),
    albedo=np.empty((0, 0, 3), np.float32),
    blur=np.empty(0, np.float32),
    tint=np.empty((0, 3), np.float32),
    textures=NO_TEXTURES,
    specular=-1,
    glass=np.empty((0, 4), np.float32),
    is_two_sided=np.empty(0, np.bool_),
    origins=NO_ORIGINS,
)
"""Of a scene in which all rays end at the first surface."""


def edge_curvature(positions: Shaped[F32, "faces 3 3"], normals: Shaped[F32, "faces 3 3"]) -> Shaped[F32, " faces"]:
    """Return the largest change of the normal along an edge of each triangle, per meter.

    Args:
        positions, normals: of the corners.
    """
    length, change = (np.linalg.norm(each - np.roll(each, 1, axis=1), axis=2) for each in (positions, normals))
    return np.asarray((change / np.maximum(length, _SHORTEST)).max(axis=1), np.float32)


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
    faces = surfaces.origins.faces
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    w = _ONE - u - v
    nx = side * (w * surfaces.normals[a, 0] + u * surfaces.normals[b, 0] + v * surfaces.normals[c, 0])
    ny = side * (w * surfaces.normals[a, 1] + u * surfaces.normals[b, 1] + v * surfaces.normals[c, 1])
    nz = side * (w * surfaces.normals[a, 2] + u * surfaces.normals[b, 2] + v * surfaces.normals[c, 2])
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < np.float32(1e-6) or nx * dx + ny * dy + nz * dz > 0:
        return (fx, fy, fz), (fx, fy, fz)
    return (nx / length, ny / length, nz / length), (fx, fy, fz)


@nb.njit(nogil=True, cache=True, inline="always")
def _set_origin_on(packet, k, origins, face, is_inner):  # type: ignore[no-untyped-def]
    """Move the origin of a lane to its hit on a face, on the outer or inner side."""
    u, v = get_uv(packet, k)
    px, py, pz = ray_origin(origins, face, u, v, -1 if is_inner else 1)
    set_origin(packet, k, px, py, pz)


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
    facing = f[0] * wx + f[1] * wy + f[2] * wz
    is_inner = face_normal[face, 0] * dx + face_normal[face, 1] * dy + face_normal[face, 2] * dz > 0
    _set_origin_on(packet, k, surfaces.origins, face, is_inner)
    set_direction(packet, k, wx, wy, wz, np.float32(np.inf))
    return is_valid and z > 0 and facing > 0


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _transmit(packet, k, material, face_normal, surfaces, throughput):  # type: ignore[no-untyped-def]
    """Let a lane pass the glass that it hits, unrefracted as shadow rays.

    Args:
        packet: the ray's origin is replaced. k: the lane. material: of the glass. face_normal: of all faces.
        surfaces: `LobeSurfaces`. throughput: multiplied by the transmittance. (3, `LANES`)
    """
    face, _ = get_hit(packet, k)
    nx, ny, nz = face_normal[face, 0], face_normal[face, 1], face_normal[face, 2]
    dx, dy, dz = get_direction(packet, k, 0), get_direction(packet, k, 1), get_direction(packet, k, 2)
    facing, f0 = nx * dx + ny * dy + nz * dz, surfaces.glass[material, 3]
    passing = _ONE - f0 - (_ONE - f0) * (_ONE - min(abs(facing), _ONE)) ** 5
    for channel in range(3):
        throughput[channel, k] *= passing * surfaces.glass[material, channel]
    _set_origin_on(packet, k, surfaces.origins, face, facing < 0)
    set_direction(packet, k, dx, dy, dz, np.float32(np.inf))


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _store(paths, entry, point, ray, kind, patch, lanes, k, direction):  # type: ignore[no-untyped-def]
    """Write an entry of paths, with the point in `first`; the rest is that of lane k."""
    paths.first[entry], paths.ray[entry], paths.kind[entry], paths.patch[entry] = point, ray, kind, patch
    paths.lobe[entry], paths.face[entry], paths.spread[entry] = lanes.lobe[k], lanes.face[k], lanes.angle[k]
    is_lit = kind == END and lanes.lobe[k] >= 0
    paths.emitter[entry], paths.emission[entry] = lanes.emitter[k] if is_lit else NO_EMITTER, lanes.emission[k]
    for row in range(paths.texture.shape[1]):
        paths.texture[entry, row] = lanes.texture[row, k]
    for axis in range(3):
        paths.throughput[entry, axis], paths.normal[entry, axis] = lanes.throughput[axis, k], lanes.normal[axis, k]
        paths.direction[entry, axis] = direction[axis]


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def look_up_hits(packet, ray, lookup, surfaces, lanes):  # type: ignore[no-untyped-def]
    """Find the patches and textures that the rays of all lanes hit.

    Args:
        packet: traced rays. ray: their index. lookup, surfaces: `PatchLookup`, `LobeSurfaces`.
        lanes: `RayLanes`; its distances grow by those of the rays.
    """
    locate_smoothly(packet, ray, lookup, lanes)
    for k in range(LANES):
        face, distance = get_hit(packet, k)
        if packet.is_active[k] != 0 and face >= 0:
            lanes.distance[k] += distance
    if surfaces.textures.slots.shape[0] > 0:
        look_up_textures(packet, surfaces.textures, surfaces.face_material, lanes)


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _look_up_emission(packet, k, face_normal, surfaces, lanes):  # type: ignore[no-untyped-def]
    """Find the material that may emit light at a lane's hit, and its image. See `LobePaths`."""
    face, _ = get_hit(packet, k)
    lanes.emitter[k] = NO_EMITTER
    if face < 0:
        return
    material = surfaces.face_material[face]
    facing = np.float32(0)
    for axis in range(3):
        facing += face_normal[face, axis] * get_direction(packet, k, axis)
    if facing < 0 or surfaces.is_two_sided[material]:
        lanes.emitter[k] = material
        lanes.emission[k] = emission_image(packet, k, face, material, surfaces.textures, lanes)


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def _tint(surfaces, lanes, k):  # type: ignore[no-untyped-def]
    """Specular texture at a lane's hit, a tuple."""
    if surfaces.specular >= 0:
        return unpack_rgb9e5(lanes.texture[surfaces.specular, k])
    tint = surfaces.tint[lanes.last[k]]
    return tint[0], tint[1], tint[2]


@nb.njit(nogil=True, cache=True, inline="always")
def is_glass(surfaces, face):  # type: ignore[no-untyped-def]
    """True if a triangle is of glass."""
    return surfaces.glass.shape[0] > 0 and surfaces.glass[surfaces.face_material[face], 0] >= 0


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def follow(packet, ray, num_rays, first, width, lookup, surfaces, lanes, paths, end):  # type: ignore[no-untyped-def]
    """Follow the rays of all lanes that hit a narrow lobe or glass, and store their ends.

    Args:
        packet: traced rays. ray: their index. num_rays: rays of a point. first, width: points of the lanes.
        lookup, surfaces: `PatchLookup`, `LobeSurfaces`. lanes: `RayLanes`, with the hits of the traced rays.
        paths: `LobePaths`, written, with the point of each path in `first`. end: number of paths so far.
    Returns:
        New number of paths.
    """
    last, lobes, throughput, has_escaped = lanes.last, lanes.lobe, lanes.throughput, lanes.has_escaped
    for k in range(LANES):
        lobes[k], lanes.face[k], has_escaped[k], last[k] = -1, -1, False, lanes.patches[k]
        lanes.num_reflections[k], lanes.is_path[k], lanes.angle[k] = 0, False, lanes.spread[k]
        throughput[0, k] = throughput[1, k] = throughput[2, k] = _ONE
    for _ in range(MAX_REFLECTIONS + _MAX_SIDES):
        num_active = 0
        for k in range(LANES):
            face = get_hit(packet, k)[0] if packet.is_active[k] != 0 else np.int32(-1)
            lobe = surfaces.lobe[surfaces.face_material[face]] if face >= 0 else np.int32(-1)
            goes_on, patch = False, last[k]
            view = -get_direction(packet, k, 0), -get_direction(packet, k, 1), -get_direction(packet, k, 2)
            if face >= 0 and is_glass(surfaces, face):
                if patch != NO_PATCH and k < width:
                    _store(paths, end, first + k, ray, END, patch, lanes, k, (-view[0], -view[1], -view[2]))
                    end += 1
                _transmit(packet, k, surfaces.face_material[face], lookup.normals, surfaces, throughput)
                goes_on, lanes.is_path[k], last[k] = True, True, NO_PATCH
            elif lobe >= 0 and lanes.num_reflections[k] < MAX_REFLECTIONS:
                tint = _tint(surfaces, lanes, k)
                for channel in range(3):
                    throughput[channel, k] *= tint[channel]
                lanes.num_reflections[k] += 1
                lanes.angle[k] += np.float32(2) * surfaces.curvature[face] * lanes.spread[k] * lanes.distance[k]
                random = ray_jitter(ray + lanes.num_reflections[k] * num_rays, lanes.seeds[k])
                goes_on = _reflect(packet, k, lobe, random, lookup.normals, surfaces, throughput, lanes.normal)
                lobes[k], last[k], lanes.is_path[k], lanes.emitter[k] = lobe, NO_PATCH, True, NO_EMITTER
                lanes.face[k] = face
                if surfaces.blur[lobe] > 0 and k < width:
                    _store(paths, end, first + k, ray, REFLECTION, patch, lanes, k, view)
                    end += 1
            enable_lane(packet, k, goes_on)
            num_active += goes_on
        if num_active == 0:
            break
        trace_hits(packet)
        look_up_hits(packet, ray, lookup, surfaces, lanes)
        for k in range(LANES):
            if packet.is_active[k] != 0:
                last[k], has_escaped[k] = lanes.patches[k], get_hit(packet, k)[0] < 0
                _look_up_emission(packet, k, lookup.normals, surfaces, lanes)
    for k in range(width):
        if lanes.is_path[k]:
            direction = get_direction(packet, k, 0), get_direction(packet, k, 1), get_direction(packet, k, 2)
            kind = END
            if has_escaped[k] and last[k] == NO_PATCH:
                kind = ESCAPE if lobes[k] >= 0 else TRANSMISSION
            _store(paths, end, first + k, ray, kind, last[k], lanes, k, direction)
            end += 1
    return end
