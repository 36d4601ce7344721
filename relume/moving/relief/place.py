"""Where in its texture a ray meets a surface, and how the texture lies there."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.moving.bumps import unit
from relume.moving.pixels import footprint_of, in_texture


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def dot(a, b):  # type: ignore[no-untyped-def]
    """Inner product of tuples of three."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def cross(a, b):  # type: ignore[no-untyped-def]
    """Cross product of tuples of three."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def row(array, k):  # type: ignore[no-untyped-def]
    """One of (n, 3) as a tuple, which is not counted as a reference."""
    return array[k, 0], array[k, 1], array[k, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _frame(p0, p1, p2, uv0, uv1, uv2, n):  # type: ignore[no-untyped-def]
    """Find the texture's axes across a normal, and whether it has a place in textures; see `relume.trace.surface`."""
    e1 = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
    e2 = p2[0] - p0[0], p2[1] - p0[1], p2[2] - p0[2]
    du1, dv1, du2, dv2 = uv1[0] - uv0[0], uv1[1] - uv0[1], uv2[0] - uv0[0], uv2[1] - uv0[1]
    area = du1 * dv2 - du2 * dv1
    sign = np.float32(1) if area > 0 else np.float32(-1)
    u = (
        sign * (e1[0] * dv2 - e2[0] * dv1),
        sign * (e1[1] * dv2 - e2[1] * dv1),
        sign * (e1[2] * dv2 - e2[2] * dv1),
    )
    v = (
        sign * (e2[0] * du1 - e1[0] * du2),
        sign * (e2[1] * du1 - e1[1] * du2),
        sign * (e2[2] * du1 - e1[2] * du2),
    )
    along = dot(u, n)
    x = unit((u[0] - along * n[0], u[1] - along * n[1], u[2] - along * n[2]))
    y = cross(n, x)
    side = np.float32(1) if dot(cross(n, u), v) < 0 else np.float32(-1)  # v runs down
    return x, y, side, area != 0


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def place_of(surface, face, uv, distance, d, eye, n, pixel_angle, turn):  # type: ignore[no-untyped-def]
    """Find where in its texture a ray meets a surface.

    Args:
        surface: positions, uvs, faces, face normals and texture side a metre, see `relume.moving.points.surface`.
        face: that it meets. uv: in that, of two corners. distance: from the eye.
        d: of the ray, unit. eye: where it begins. n: normal there, unit. pixel_angle: that a pixel spans, radians.
        turn: cosine and sine of the texture's rotation.
    Returns:
        The texture's axes x and y; −1 where it is seen in a mirror, else 1; column and row and side of the pixel's
        footprint, in repeats.
    """
    positions, uvs, faces, face_normal, uv_scale = surface
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    uv0, uv1, uv2 = (uvs[a, 0], uvs[a, 1]), (uvs[b, 0], uvs[b, 1]), (uvs[c, 0], uvs[c, 1])
    x, y, side, has_place = _frame(row(positions, a), row(positions, b), row(positions, c), uv0, uv1, uv2, n)
    outward = row(face_normal, face)
    along = dot(outward, d)
    if has_place:
        u, down = in_texture(uvs, (a, b, c), uv)
        up, metre = -down, uv_scale[face]
        y = side * y[0], side * y[1], side * y[2]
    else:
        away = np.float32(-1) if along > 0 else np.float32(1)
        x, y = _projected((away * outward[0], away * outward[1], away * outward[2]))
        place = eye[0] + distance * d[0], eye[1] + distance * d[1], eye[2] + distance * d[2]
        u, up, metre, side = dot(place, x), dot(place, y), np.float32(1), np.float32(1)
    footprint = footprint_of(distance, pixel_angle, metre, along)
    c, s = turn
    x, y = (
        (c * x[0] + s * y[0], c * x[1] + s * y[1], c * x[2] + s * y[2]),
        (c * y[0] - s * x[0], c * y[1] - s * x[1], c * y[2] - s * x[2]),
    )
    return x, y, side, c * u + s * up, s * u - c * up, footprint
