"""From what an eye sees to the points about it: which three, with which weights, and textures there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.lattice import node_of
from relume.moving.surface import Surface
from relume.parallel import for_shares
from relume.scene.model import Camera
from relume.trace.embree import EmbreeScene
from relume.trace.primary import Hits, trace_from

F32 = NDArray[np.float32]


class Seen(NamedTuple):
    """What the pixels of a picture see, row after row.

    Attributes:
        hits: of the eye's rays. directions: of these, unit. (n, 3) float32
        point: the three about each hit. (n, 3) uint32. weight: of each; all zero where there are none. (n, 3) float32
        is_needed: whether any pixel sees a point. (points,) uint8
    """

    hits: Hits
    directions: F32
    point: NDArray[np.uint32]
    weight: F32
    is_needed: NDArray[np.uint8]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _aim(rotation, half_width, half_height, width, height, start, stop, out):  # type: ignore[no-untyped-def]
    """Direct the rays through the middles of pixels [start, stop)."""
    for p in range(start, stop):
        y, x = p // width, p % width
        a = (np.float32(2) * (x + np.float32(0.5)) / width - np.float32(1)) * half_width
        b = (np.float32(1) - np.float32(2) * (y + np.float32(0.5)) / height) * half_height
        scale = np.float32(1) / math.sqrt(a * a + b * b + np.float32(1))
        for axis in range(3):
            out[p, axis] = scale * (rotation[axis, 0] * a + rotation[axis, 1] * b - rotation[axis, 2])


@nb.njit(nogil=True, cache=True, inline="always")
def _nodes_about(lattice, face, side, u, v):  # type: ignore[no-untyped-def]
    """Find the three nodes about a place in a face, and their weights."""
    rows = np.int64(lattice.num_rows[face, side])
    x: Any = u * rows
    y: Any = v * rows
    i: Any = min(max(np.int64(x), 0), rows - 1)
    j: Any = min(max(np.int64(y), 0), rows - 1 - i)
    fx: Any = x - i
    fy: Any = y - j
    first = np.int64(lattice.first[face, side])
    b, c = first + node_of(rows, i + 1, j), first + node_of(rows, i, j + 1)
    if fx + fy <= 1 or i + j == rows - 1:
        return first + node_of(rows, i, j), b, c, np.float32(1 - fx - fy), np.float32(fx), np.float32(fy)
    return first + node_of(rows, i + 1, j + 1), b, c, np.float32(fx + fy - 1), np.float32(1 - fy), np.float32(1 - fx)


@nb.njit(nogil=True, cache=True)
def _find(lattice, positions, faces, face, uv, directions, start, stop, point, weight, is_needed):  # type: ignore[no-untyped-def]
    """Find the points about hits [start, stop); of a side without any, those of the other."""
    for p in range(start, stop):
        f = face[p]
        weight[p] = 0
        if f < 0:
            continue
        a, b, c = positions[faces[f, 0]], positions[faces[f, 1]], positions[faces[f, 2]]
        e, g = b - a, c - a
        d = directions[p]
        along = (
            (e[1] * g[2] - e[2] * g[1]) * d[0] + (e[2] * g[0] - e[0] * g[2]) * d[1] + (e[0] * g[1] - e[1] * g[0]) * d[2]
        )
        side = 1 if along > 0 else 0
        if lattice.num_rows[f, side] == 0:
            side = 1 - side
        if lattice.num_rows[f, side] == 0:
            continue
        n0, n1, n2, w0, w1, w2 = _nodes_about(lattice, f, side, uv[p, 0], uv[p, 1])
        point[p, 0], point[p, 1], point[p, 2] = lattice.node[n0], lattice.node[n1], lattice.node[n2]
        weight[p, 0], weight[p, 1], weight[p, 2] = w0, w1, w2
        for k in range(3):
            is_needed[point[p, k]] = 1


def look(
    surface: Surface,
    embree: EmbreeScene,
    positions: F32,
    faces: NDArray[np.uint32],
    camera: Camera,
    size: tuple[int, int],
) -> Seen:
    """Find what every pixel of a picture sees.

    Args:
        surface: the points. embree: the triangles, positions: their corners, (num_vertices, 3) float32, faces: and
            which of these are whose. (num_faces, 3) uint32
        camera: the eye. size: width and height in pixels.
    """
    width, height = size
    num = width * height
    half_height = np.float32(math.tan(camera.yfov / 2))
    rotation = np.ascontiguousarray(camera.to_world[:3, :3], np.float32)
    directions = np.empty((num, 3), np.float32)
    aim = (rotation, np.float32(half_height * width / height), half_height, width, height)
    for_shares(lambda start, stop: _aim(*aim, start, stop, directions), num)
    hits = trace_from(embree, camera.to_world[:3, 3].astype(np.float32), directions)
    point, weight = np.zeros((num, 3), np.uint32), np.empty((num, 3), np.float32)
    is_needed = np.zeros(surface.points.num_points, np.uint8)
    args = (surface.lattice, positions, faces, hits.face, hits.uv, directions)
    for_shares(lambda start, stop: _find(*args, start, stop, point, weight, is_needed), num)
    return Seen(hits, directions, point, weight, is_needed)


@nb.njit(nogil=True, cache=True, inline="always")
def _texel(wrap, index, size):  # type: ignore[no-untyped-def]
    """Wrap a texel's index into an image."""
    if wrap == 2:
        return min(max(index, 0), size - 1)
    if wrap == 1:
        folded = index % (2 * size)
        return min(folded, 2 * size - 1 - folded)
    return index % size


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_level(textures, texture, level, u, v, share, out):  # type: ignore[no-untyped-def]
    """Add a share of a bilinear lookup in one level of a texture. out: (3,)"""
    first, height, width = textures.levels[textures.first[texture] + level]
    x, y = u * width - 0.5, v * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - x0, y - y0
    for dy in range(2):
        row = first + _texel(textures.wraps[texture, 1], np.int64(y0) + dy, height) * width
        wy = share * (fy if dy else 1 - fy)
        for dx in range(2):
            at = row + _texel(textures.wraps[texture, 0], np.int64(x0) + dx, width)
            w = wy * (fx if dx else 1 - fx)
            for channel in range(3):
                out[channel] += w * textures.texels[at, channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _combine(  # type: ignore[no-untyped-def]
    textures, positions, uvs, faces, face_material, pixel_angle, hits, directions, point, weight, sent, emission,
    start, stop, out,
):  # fmt: skip
    """Sum what points send along the rays of pixels [start, stop), and what surfaces emit."""
    face, uv, distance = hits
    texture_value = np.empty(3, np.float64)
    for p in range(start, stop):
        f = face[p]
        if f < 0:
            continue
        material = face_material[f]
        for channel in range(3):
            out[p, channel] = emission[material, channel]
        for group in range(3):
            texture_value[:] = 1
            texture = textures.of_material[material, group - 1] if group else -1
            if texture >= 0:
                u, v, footprint = _place_in_texture(
                    positions, uvs, faces[f], uv[p], distance[p], directions[p], pixel_angle
                )
                _sample(textures, texture, u, v, footprint, texture_value)
            for channel in range(3):
                total = np.float32(0)
                for k in range(3):
                    total += weight[p, k] * sent[point[p, k], group, channel]
                out[p, channel] += np.float32(texture_value[channel]) * max(total, np.float32(0))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _place_in_texture(positions, uvs, corners, uv, distance, direction, pixel_angle):  # type: ignore[no-untyped-def]
    """Find u, v of a hit, and the side of a pixel's footprint there; as `relume.trace.surface` does."""
    a, b, c = corners[0], corners[1], corners[2]
    w0 = 1 - uv[0] - uv[1]
    u = w0 * uvs[a, 0] + uv[0] * uvs[b, 0] + uv[1] * uvs[c, 0]
    v = w0 * uvs[a, 1] + uv[0] * uvs[b, 1] + uv[1] * uvs[c, 1]
    e, g = positions[b] - positions[a], positions[c] - positions[a]
    x, y, z = e[1] * g[2] - e[2] * g[1], e[2] * g[0] - e[0] * g[2], e[0] * g[1] - e[1] * g[0]
    twice_area = math.sqrt(x * x + y * y + z * z)
    cosine = abs(x * direction[0] + y * direction[1] + z * direction[2]) / max(twice_area, 1e-20)
    uv_area = abs((uvs[b, 0] - uvs[a, 0]) * (uvs[c, 1] - uvs[a, 1]) - (uvs[b, 1] - uvs[a, 1]) * (uvs[c, 0] - uvs[a, 0]))
    footprint = distance * pixel_angle * math.sqrt(uv_area / max(twice_area, 1e-20) / max(cosine, 0.05))
    return u, v, footprint


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sample(textures, texture, u, v, footprint, out):  # type: ignore[no-untyped-def]
    """Look a texture up, trilinear. out: (3,), written"""
    first = textures.first[texture]
    last = textures.first[texture + 1] - first - 1
    size = max(textures.levels[first, 1], textures.levels[first, 2])
    level = min(math.log2(max(footprint * size, 1.0)), last)
    lower = np.int64(level)
    share = level - lower
    out[:] = 0
    _add_level(textures, texture, lower, u, v, 1 - share, out)
    if share > 0:
        _add_level(textures, texture, min(lower + 1, last), u, v, share, out)


def combine(
    surface: Surface,
    positions: F32,
    faces: NDArray[np.uint32],
    seen: Seen,
    pixel_angle: float,
    sent: F32,
    emission: F32,
) -> F32:
    """Find the radiance of every pixel that sees a surface; the others are black.

    Args:
        surface: the points. positions, faces: as of `look`. seen: from it.
        pixel_angle: angle that a pixel spans, radians.
        sent: radiance of every point to the eye: untextured, then by each of `TEXTURES`. (points, 3, 3) float32
        emission: radiance of each material's own. (materials, 3) float32
    Returns:
        (pixels, 3) float32
    """
    out = np.zeros((len(seen.directions), 3), np.float32)
    hits = (seen.hits.face, seen.hits.uv, seen.hits.distance)
    args = (
        surface.textures, positions, surface.uvs, faces, surface.face_material, float(pixel_angle), hits,
        seen.directions, seen.point, seen.weight, sent, emission,
    )  # fmt: skip
    for_shares(lambda start, stop: _combine(*args, start, stop, out), len(out))
    return out
