"""Where in their textures rays meet surfaces, and how textures lie there: of some rays at once.

What rays see is gathered into columns, one for each number; then loops go along the columns, without branches, which
are vector code. Columns lie in one flat array at constant places: of several arrays nobody could tell that they are
not the same memory.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.arcs import acos_clamped, azimuth_turns
from relume.moving.pixels import footprint_of
from relume.moving.points.surface import Surface
from relume.project.texels import level_of
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_LEAST = np.float32(1e-30)
_MOST = np.float32(1 << 30)  # repeats: beyond, float32 knows no share of one

AT_ONCE = 64  # rays; all columns of them stay in the first cache
X, Y, N, SIDE, U, V, LEVEL, THETA, TURN = (AT_ONCE * k for k in (0, 3, 6, 9, 10, 11, 12, 13, 14))
"""Where columns begin that `lay` fills: the texture's axes x and y and the normal, three columns each; −1 where the
texture is seen in a mirror, else 1; column and row in it, shares of a repeat; level of halvings, see `texels_at`; θ and
share of a turn of the direction to the eye, see `taps_at`."""
_TO1, _TO2, _OUTWARD, _METRE, _D, _UV, _DISTANCE = (AT_ONCE * k for k in (15, 17, 19, 22, 23, 26, 28))
NUM_COLUMNS = 29
_OF_FACE = np.array([X, X + AT_ONCE, X + 2 * AT_ONCE, SIDE, U, V, _TO1, _TO1 + AT_ONCE, _TO2, _TO2 + AT_ONCE,
                     _OUTWARD, _OUTWARD + AT_ONCE, _OUTWARD + 2 * AT_ONCE, _METRE])  # fmt: skip
"""Where the numbers of `face_places` go."""


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def dot(a, b):  # type: ignore[no-untyped-def]
    """Inner product of tuples of three."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def cross(a, b):  # type: ignore[no-untyped-def]
    """Cross product of tuples of three."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def row(array, k):  # type: ignore[no-untyped-def]
    """One of (n, 3) as a tuple, which is not counted as a reference."""
    return array[k, 0], array[k, 1], array[k, 2]


def face_places(positions: F32, surface: Surface) -> F32:
    """Find what of triangles tells where in textures their places are: one row, one line of the cache, for each.

    Args:
        positions: of the triangles' corners, metres. (corners, 3) float32. surface: that they are.
    Returns:
        The texture's x axis along the triangle, unit; the hand of its axes, 1 where y is to the left of x about the
        normal of counter-clockwise corners, else −1, 0 without a place in textures; the place of the first corner; from
        there to the second and to the third; the face's normal; texture side a metre; see `relume.trace.surface`.
        (num_faces, 16) float32
    """
    p, uv = positions[surface.faces], surface.uvs[surface.faces]
    e1, e2, to1, to2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    hand = np.sign(to1[:, 1] * to2[:, 0] - to1[:, 0] * to2[:, 1])  # v runs down
    along = -hand[:, None] * (e1 * to2[:, 1:] - e2 * to1[:, 1:])
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), _LEAST)
    out = np.zeros((len(p), 16), np.float32)
    out[:, :3], out[:, 3], out[:, 4:6], out[:, 6:8], out[:, 8:10] = along, hand, uv[:, 0], to1, to2
    out[:, 10:13], out[:, 13] = surface.face_normal, surface.uv_scale
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _projected(face_normal):  # type: ignore[no-untyped-def]
    """Find the axes of a texture that is projected along the axis of the world that a face looks along most."""
    a, b, c = abs(face_normal[0]), abs(face_normal[1]), abs(face_normal[2])
    zero, one = np.float32(0), np.float32(1)
    if a >= b and a >= c:
        sign = one if face_normal[0] > 0 else -one
        across, axis = (zero, zero, -sign), (sign, zero, zero)
    elif b >= c:
        sign = one if face_normal[1] > 0 else -one
        across, axis = (one, zero, zero), (zero, sign, zero)
    else:
        sign = one if face_normal[2] > 0 else -one
        across, axis = (sign, zero, zero), (zero, zero, sign)
    return across, cross(axis, across)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def gather(places, normals, face, uv, distance, directions, vertex, weight, rows, start, num, columns):  # type: ignore[no-untyped-def]
    """Gather what rays rows[start:start + num] see, at most `AT_ONCE`.

    Args:
        places: from `face_places`. normals: of vertices. face, uv, distance: that rays meet. directions: of them.
        vertex, weight: about what they see. columns: written. (NUM_COLUMNS · AT_ONCE,)
    """
    for j in range(num):
        ray = rows[start + j]
        f, a, b, c = face[ray], vertex[ray, 0], vertex[ray, 1], vertex[ray, 2]
        w0, w1, w2 = weight[ray, 0], weight[ray, 1], weight[ray, 2]
        for k in range(14):
            columns[_OF_FACE[k] + j] = places[f, k]
        for k in range(3):
            columns[N + k * AT_ONCE + j] = w0 * normals[a, k] + w1 * normals[b, k] + w2 * normals[c, k]
            columns[_D + k * AT_ONCE + j] = directions[ray, k]
        columns[_UV + j], columns[_UV + AT_ONCE + j], columns[_DISTANCE + j] = uv[ray, 0], uv[ray, 1], distance[ray]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def three(columns, first, j):  # type: ignore[no-untyped-def]
    """Row j of the three columns that begin at `first`, a tuple of what `columns` has."""
    return columns[first + j], columns[first + AT_ONCE + j], columns[first + 2 * AT_ONCE + j]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _set_three(columns, first, j, of):  # type: ignore[no-untyped-def]
    """Write a tuple into one row of three columns."""
    columns[first + j], columns[first + AT_ONCE + j], columns[first + 2 * AT_ONCE + j] = of


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _unit(vector):  # type: ignore[no-untyped-def]
    scale = np.float32(1) / math.sqrt(max(dot(vector, vector), _LEAST))
    return scale * vector[0], scale * vector[1], scale * vector[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _frame(columns):  # type: ignore[no-untyped-def]
    """Find axes across normals, and places in repeats, where faces have some."""
    for j in range(AT_ONCE):
        n, along, outward = _unit(three(columns, N, j)), three(columns, X, j), three(columns, _OUTWARD, j)
        leant, hand = dot(along, n), columns[SIDE + j]
        x = _unit((along[0] - leant * n[0], along[1] - leant * n[1], along[2] - leant * n[2]))
        y, side = cross(n, x), hand if dot(n, outward) > 0 else -hand
        s, t = columns[_UV + j], columns[_UV + AT_ONCE + j]
        columns[U + j] += s * columns[_TO1 + j] + t * columns[_TO2 + j]
        columns[V + j] += s * columns[_TO1 + AT_ONCE + j] + t * columns[_TO2 + AT_ONCE + j]
        columns[SIDE + j] = side
        _set_three(columns, N, j, n)
        _set_three(columns, X, j, x)
        _set_three(columns, Y, j, (side * y[0], side * y[1], side * y[2]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _project(columns, eye, num):  # type: ignore[no-untyped-def]
    """Find axes and places of faces without any: textures are projected onto them, a metre for each repeat."""
    for j in range(num):
        if columns[SIDE + j] != 0:
            continue
        d, outward, distance = three(columns, _D, j), three(columns, _OUTWARD, j), columns[_DISTANCE + j]
        away = np.float32(-1) if dot(outward, d) > 0 else np.float32(1)
        x, y = _projected((away * outward[0], away * outward[1], away * outward[2]))
        place = eye[0] + distance * d[0], eye[1] + distance * d[1], eye[2] + distance * d[2]
        columns[U + j], columns[V + j] = dot(place, x), -dot(place, y)
        columns[SIDE + j] = columns[_METRE + j] = np.float32(1)
        _set_three(columns, X, j, x)
        _set_three(columns, Y, j, y)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _share(place):  # type: ignore[no-untyped-def]
    """What a place is beyond whole repeats, whatever it is; a floor would be a call."""
    near: Any = min(max(place, -_MOST), _MOST)
    beyond = np.float32(near - np.float32(np.int32(near)))
    return beyond + np.float32(1) if beyond < 0 else beyond


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def lay(columns, num, eye, pixel_angle, turned, scale, finest):  # type: ignore[no-untyped-def]
    """Find where gathered rays meet their texture, and how it lies there.

    Args:
        columns: from `gather`; those of which the module tells are written. num: of rays. eye: where they begin.
        pixel_angle: that a pixel spans, radians. turned: cosine and sine of the texture's rotation.
        scale: repeats along a unit of texture coordinates. finest: side of the texture, in texels.
    """
    _frame(columns)
    _project(columns, eye, num)
    c, s = turned
    for j in range(AT_ONCE):
        n, d, a, b = three(columns, N, j), three(columns, _D, j), three(columns, X, j), three(columns, Y, j)
        x = c * a[0] + s * b[0], c * a[1] + s * b[1], c * a[2] + s * b[2]
        y = c * b[0] - s * a[0], c * b[1] - s * a[1], c * b[2] - s * a[2]
        u, down = columns[U + j], columns[V + j]
        slant = dot(three(columns, _OUTWARD, j), d)
        footprint = scale * footprint_of(columns[_DISTANCE + j], pixel_angle, columns[_METRE + j], slant)
        columns[U + j], columns[V + j] = _share(scale * (c * u - s * down)), _share(scale * (s * u + c * down))
        columns[LEVEL + j] = level_of(footprint, finest)
        columns[THETA + j], columns[TURN + j] = acos_clamped(-dot(d, n)), azimuth_turns(-dot(d, x), -dot(d, y))
        _set_three(columns, X, j, x)
        _set_three(columns, Y, j, y)
