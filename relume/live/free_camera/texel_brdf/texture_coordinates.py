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

from relume.core.numba_options import UNCOUNTED
from relume.live.free_camera.probes.stored_scene import StoredScene
from relume.live.free_camera.shade_pixels import texture_footprint
from relume.math.fast_math import acos_clamped, azimuth_fraction
from relume.transport.btf_kernel import mip_level

F32 = NDArray[np.float32]

_EPSILON = np.float32(1e-30)
_MAX_REPEATS = np.float32(1 << 30)  # repeats: beyond, float32 knows no share of one

BATCH_SIZE = 64  # rays; all columns of them stay in the first cache
X, Y, N, SIDE, U, V, LEVEL, THETA, AZIMUTH = (BATCH_SIZE * k for k in (0, 3, 6, 9, 10, 11, 12, 13, 14))
"""Where columns begin that `map_to_texture` fills: the texture's axes x and y and the normal, three columns each; −1
where the texture is seen in a mirror, else 1; column and row in it, shares of a repeat; level of halvings, see
`texels_at_level`; θ and share of a turn of the direction to the camera, see `interpolation_weights_at`."""
_TO1, _TO2, _OUTWARD, _UV_SCALE, _D, _UV, _DISTANCE = (BATCH_SIZE * k for k in (15, 17, 19, 22, 23, 26, 28))
NUM_COLUMNS = 29
_FACE_COLUMNS = np.array([
    X, X + BATCH_SIZE, X + 2 * BATCH_SIZE, SIDE, U, V, _TO1, _TO1 + BATCH_SIZE, _TO2, _TO2 + BATCH_SIZE,
    _OUTWARD, _OUTWARD + BATCH_SIZE, _OUTWARD + 2 * BATCH_SIZE, _UV_SCALE,
])  # fmt: skip
"""Where the numbers of `face_placements` go."""


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def dot(a, b):  # type: ignore[no-untyped-def]
    """Inner product of tuples of three."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def cross(a, b):  # type: ignore[no-untyped-def]
    """Cross product of tuples of three."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def vector_row(array, k):  # type: ignore[no-untyped-def]
    """One of (n, 3) as a tuple, which is not counted as a reference."""
    return array[k, 0], array[k, 1], array[k, 2]


def face_placements(positions: F32, stored_scene: StoredScene) -> F32:
    """Find what of triangles tells where in textures their places are: one row, one line of the cache, for each.

    Args:
        positions: of the triangles' corners, metres. (corners, 3) float32. stored_scene: that they are.
    Returns:
        The texture's x axis along the triangle, unit; the hand of its axes, 1 where y is to the left of x about the
        normal of counter-clockwise corners, else −1, 0 without a place in textures; the place of the first corner; from
        there to the second and to the third; the face's normal; texture side a metre; see
        `relume.raytrace.surface_interaction`. (num_faces, 16) float32
    """
    p, uv = positions[stored_scene.faces], stored_scene.uvs[stored_scene.faces]
    e1, e2, to1, to2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    handedness = np.sign(to1[:, 1] * to2[:, 0] - to1[:, 0] * to2[:, 1])  # v runs down
    x_axis = -handedness[:, None] * (e1 * to2[:, 1:] - e2 * to1[:, 1:])
    x_axis /= np.maximum(np.linalg.norm(x_axis, axis=1, keepdims=True), _EPSILON)
    out = np.zeros((len(p), 16), np.float32)
    out[:, :3], out[:, 3], out[:, 4:6], out[:, 6:8], out[:, 8:10] = x_axis, handedness, uv[:, 0], to1, to2
    out[:, 10:13], out[:, 13] = stored_scene.face_normal, stored_scene.uv_scale
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _projected_axes(face_normal):  # type: ignore[no-untyped-def]
    """Find the axes of a texture that is projected along the axis of the world that a face looks along most."""
    a, b, c = abs(face_normal[0]), abs(face_normal[1]), abs(face_normal[2])
    zero, unit = np.float32(0), np.float32(1)
    if a >= b and a >= c:
        sign = unit if face_normal[0] > 0 else -unit
        across, axis = (zero, zero, -sign), (sign, zero, zero)
    elif b >= c:
        sign = unit if face_normal[1] > 0 else -unit
        across, axis = (unit, zero, zero), (zero, sign, zero)
    else:
        sign = unit if face_normal[2] > 0 else -unit
        across, axis = (sign, zero, zero), (zero, zero, sign)
    return across, cross(axis, across)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def gather_hits(placements, normals, face, uv, distance, directions, lattice_node, weight, rows, start, num, columns):  # type: ignore[no-untyped-def]
    """Gather what rays rows[start:start + num] see, at most `BATCH_SIZE`.

    Args:
        placements: from `face_placements`. normals: of vertices. face, uv, distance: that rays meet. directions: of
            them.
        lattice_node, weight: about what they see. columns: written. (NUM_COLUMNS · AT_ONCE,)
    """
    for j in range(num):
        ray = rows[start + j]
        f, a, b, c = face[ray], lattice_node[ray, 0], lattice_node[ray, 1], lattice_node[ray, 2]
        w0, w1, w2 = weight[ray, 0], weight[ray, 1], weight[ray, 2]
        for k in range(14):
            columns[_FACE_COLUMNS[k] + j] = placements[f, k]
        for k in range(3):
            columns[N + k * BATCH_SIZE + j] = w0 * normals[a, k] + w1 * normals[b, k] + w2 * normals[c, k]
            columns[_D + k * BATCH_SIZE + j] = directions[ray, k]
        columns[_UV + j], columns[_UV + BATCH_SIZE + j], columns[_DISTANCE + j] = uv[ray, 0], uv[ray, 1], distance[ray]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def get_vector(columns, first, j):  # type: ignore[no-untyped-def]
    """Row j of the three columns that begin at `first`, a tuple of what `columns` has."""
    return columns[first + j], columns[first + BATCH_SIZE + j], columns[first + 2 * BATCH_SIZE + j]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _set_vector(columns, first, j, vector):  # type: ignore[no-untyped-def]
    """Write a tuple into one row of three columns."""
    columns[first + j], columns[first + BATCH_SIZE + j], columns[first + 2 * BATCH_SIZE + j] = vector


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _normalize(vector):  # type: ignore[no-untyped-def]
    scale = np.float32(1) / math.sqrt(max(dot(vector, vector), _EPSILON))
    return scale * vector[0], scale * vector[1], scale * vector[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _tangent_frames(columns):  # type: ignore[no-untyped-def]
    """Find axes across normals, and places in repeats, where faces have some."""
    for j in range(BATCH_SIZE):
        n, x_axis, outward = (
            _normalize(get_vector(columns, N, j)),
            get_vector(columns, X, j),
            get_vector(columns, _OUTWARD, j),
        )
        projection, handedness = dot(x_axis, n), columns[SIDE + j]
        x = _normalize((x_axis[0] - projection * n[0], x_axis[1] - projection * n[1], x_axis[2] - projection * n[2]))
        y, side = cross(n, x), handedness if dot(n, outward) > 0 else -handedness
        s, t = columns[_UV + j], columns[_UV + BATCH_SIZE + j]
        columns[U + j] += s * columns[_TO1 + j] + t * columns[_TO2 + j]
        columns[V + j] += s * columns[_TO1 + BATCH_SIZE + j] + t * columns[_TO2 + BATCH_SIZE + j]
        columns[SIDE + j] = side
        _set_vector(columns, N, j, n)
        _set_vector(columns, X, j, x)
        _set_vector(columns, Y, j, (side * y[0], side * y[1], side * y[2]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _project_uv(columns, camera_position, num):  # type: ignore[no-untyped-def]
    """Find axes and places of faces without any: textures are projected onto them, a metre for each repeat."""
    for j in range(num):
        if columns[SIDE + j] != 0:
            continue
        d, outward, distance = get_vector(columns, _D, j), get_vector(columns, _OUTWARD, j), columns[_DISTANCE + j]
        sign = np.float32(-1) if dot(outward, d) > 0 else np.float32(1)
        x, y = _projected_axes((sign * outward[0], sign * outward[1], sign * outward[2]))
        position = (
            camera_position[0] + distance * d[0],
            camera_position[1] + distance * d[1],
            camera_position[2] + distance * d[2],
        )
        columns[U + j], columns[V + j] = dot(position, x), -dot(position, y)
        columns[SIDE + j] = columns[_UV_SCALE + j] = np.float32(1)
        _set_vector(columns, X, j, x)
        _set_vector(columns, Y, j, y)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _repeat_fraction(coordinate):  # type: ignore[no-untyped-def]
    """What a place is beyond whole repeats, whatever it is; a floor would be a call."""
    clamped: Any = min(max(coordinate, -_MAX_REPEATS), _MAX_REPEATS)
    fraction = np.float32(clamped - np.float32(np.int32(clamped)))
    return fraction + np.float32(1) if fraction < 0 else fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def map_to_texture(columns, num, camera_position, pixel_angle, rotation, scale, finest):  # type: ignore[no-untyped-def]
    """Find where gathered rays meet their texture, and how it lies there.

    Args:
        columns: from `gather`; those of which the module tells are written. num: of rays. camera_position: where they
            begin.
        pixel_angle: that a pixel spans, radians. rotation: cosine and sine of the texture's rotation.
        scale: repeats along a unit of texture coordinates. finest: side of the texture, in texels.
    """
    _tangent_frames(columns)
    _project_uv(columns, camera_position, num)
    c, s = rotation
    for j in range(BATCH_SIZE):
        n, d, a, b = (
            get_vector(columns, N, j),
            get_vector(columns, _D, j),
            get_vector(columns, X, j),
            get_vector(columns, Y, j),
        )
        x = c * a[0] + s * b[0], c * a[1] + s * b[1], c * a[2] + s * b[2]
        y = c * b[0] - s * a[0], c * b[1] - s * a[1], c * b[2] - s * a[2]
        u, v = columns[U + j], columns[V + j]
        view_cosine = dot(get_vector(columns, _OUTWARD, j), d)
        footprint = scale * texture_footprint(columns[_DISTANCE + j], pixel_angle, columns[_UV_SCALE + j], view_cosine)
        columns[U + j], columns[V + j] = (
            _repeat_fraction(scale * (c * u - s * v)),
            _repeat_fraction(scale * (s * u + c * v)),
        )
        columns[LEVEL + j] = mip_level(footprint, finest)
        columns[THETA + j], columns[AZIMUTH + j] = acos_clamped(-dot(d, n)), azimuth_fraction(-dot(d, x), -dot(d, y))
        _set_vector(columns, X, j, x)
        _set_vector(columns, Y, j, y)
