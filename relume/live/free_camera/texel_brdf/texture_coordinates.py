"""Texture coordinates and tangent frames at the hits of a batch of rays.

Hits are gathered into columns, one per quantity; the loops along the columns have no branches, so that they compile to
SIMD code. The columns share one flat array at constant offsets: for separate arrays the compiler could not exclude
aliasing.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.live.free_camera.shade_pixels import texture_footprint
from relume.math.fast_math import acos_clamped, azimuth_fraction
from relume.probes.stored_scene import StoredScene
from relume.transport.btf_kernel import mip_level

F32 = NDArray[np.float32]

_EPSILON = np.float32(1e-30)
_FILTER_WIDTH = np.float32(2 / math.sqrt(3))  # gives one bilinear lookup, box and tent, the variance of the footprint
_MAX_REPEATS = np.float32(1 << 30)  # repeats: beyond, float32 has no fraction of one

BATCH_SIZE = 64  # rays; all their columns fit the L1 cache
X, Y, N, SIDE, U, V, LEVEL, THETA, AZIMUTH, SHEAR = (BATCH_SIZE * k for k in (0, 3, 6, 9, 10, 11, 12, 13, 14, 29))
"""Offsets of the columns that `map_to_texture` writes: texture axes x and y and the normal, three columns each;
handedness, −1 if the texture is mirrored, else 1; u and v as fractions of a repeat; mip level, see `texels_at_level`;
θ, and azimuth as a fraction of a turn, of the view direction, see `interpolation_weights_at`; its parallax shear, two
columns, see `relume.assets.btf.parallax`."""
_TO1, _TO2, _OUTWARD, _UV_SCALE, _D, _UV, _DISTANCE = (BATCH_SIZE * k for k in (15, 17, 19, 22, 23, 26, 28))
NUM_COLUMNS = 31
_FACE_COLUMNS = np.array([
    X, X + BATCH_SIZE, X + 2 * BATCH_SIZE, SIDE, U, V, _TO1, _TO1 + BATCH_SIZE, _TO2, _TO2 + BATCH_SIZE,
    _OUTWARD, _OUTWARD + BATCH_SIZE, _OUTWARD + 2 * BATCH_SIZE, _UV_SCALE,
])  # fmt: skip
"""Columns that the rows of `face_placements` are copied to."""


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def dot(a, b):  # type: ignore[no-untyped-def]
    """Inner product of tuples of three."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def cross(a, b):  # type: ignore[no-untyped-def]
    """Cross product of tuples of three."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def vector_row(array, k):  # type: ignore[no-untyped-def]
    """One of (n, 3) as a tuple, which is not counted as a reference."""
    return array[k, 0], array[k, 1], array[k, 2]


def face_placements(positions: Shaped[F32, "corners 3"], stored_scene: StoredScene) -> Shaped[F32, "faces 16"]:
    """Return the placement of the texture on each triangle: one row, one cache line.

    Args:
        positions: positions of triangle corners, meters. stored_scene: has the triangles.
    Returns:
        Texture x axis along the triangle, unit; handedness of its axes, 1 if y is to the left of x about the normal of
        counterclockwise corners, else −1, 0 without texture coordinates; coordinates of the first corner; from there to
        the second and to the third; face normal; texture units per meter; see `relume.raytrace.surface_interaction`.
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _projected_axes(face_normal):  # type: ignore[no-untyped-def]
    """Return the texture axes of tri-planar projection along the world axis nearest to the face normal."""
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def gather_hits(placements, normals, gbuffer, rows, start, num, columns):  # type: ignore[no-untyped-def]
    """Gather the hits of rays rows[start:start + num] into columns; at most `BATCH_SIZE` rays.

    Args:
        placements: from `face_placements`. normals: of lattice nodes. gbuffer: of the rays.
        columns: written. (NUM_COLUMNS · BATCH_SIZE,)
    """
    (face, uv, distance), directions, _, lattice_node, weight, _, _, _ = gbuffer
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def get_vector(columns, first, j):  # type: ignore[no-untyped-def]
    """Return row j of the three columns that begin at `first`, as a tuple."""
    return columns[first + j], columns[first + BATCH_SIZE + j], columns[first + 2 * BATCH_SIZE + j]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _set_vector(columns, first, j, vector):  # type: ignore[no-untyped-def]
    """Write a tuple into row j of three columns."""
    columns[first + j], columns[first + BATCH_SIZE + j], columns[first + 2 * BATCH_SIZE + j] = vector


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _normalize(vector):  # type: ignore[no-untyped-def]
    scale = np.float32(1) / math.sqrt(max(dot(vector, vector), _EPSILON))
    return scale * vector[0], scale * vector[1], scale * vector[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _tangent_frames(columns):  # type: ignore[no-untyped-def]
    """Compute tangent frames about the shading normals, and texture coordinates of faces that have them."""
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _project_uv(columns, camera_position, num):  # type: ignore[no-untyped-def]
    """Compute axes and coordinates of faces without texture coordinates: tri-planar projection, one per meter."""
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def repeat_fraction(coordinate):  # type: ignore[no-untyped-def]
    """Return the fraction of a repeat; written out, because floor would be a call."""
    clamped = min(max(coordinate, -_MAX_REPEATS), _MAX_REPEATS)
    fraction = np.float32(clamped - np.float32(np.int32(clamped)))
    return fraction + np.float32(1) if fraction < 0 else fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def map_to_texture(columns, num, camera_position, pixel_angle, rotation, scale, finest, max_slope):  # type: ignore[no-untyped-def]
    """Compute where gathered rays hit their texture, and its frame there.

    Args:
        columns: from `gather_hits`; the columns named above are written. num: rays. camera_position: origin of the
            rays.
        pixel_angle: angle of a pixel, radians. rotation: cosine and sine of the texture's rotation.
        scale: repeats per unit of texture coordinates. finest: side of the finest mip level, texels.
        max_slope: largest parallax shear.
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
            repeat_fraction(scale * (c * u - s * v)),
            repeat_fraction(scale * (s * u + c * v)),
        )
        columns[LEVEL + j] = mip_level(_FILTER_WIDTH * footprint, finest)
        wx, wy, wz = -dot(d, x), -dot(d, y), -dot(d, n)
        columns[THETA + j], columns[AZIMUTH + j] = acos_clamped(wz), azimuth_fraction(wx, wy)
        inverse = np.float32(1) / max(wz, math.sqrt(wx * wx + wy * wy) / max_slope, _EPSILON)
        columns[SHEAR + j], columns[SHEAR + BATCH_SIZE + j] = inverse * wx, inverse * wy
        _set_vector(columns, X, j, x)
        _set_vector(columns, Y, j, y)
