"""The share of a narrow lobe that a triangle covers, without noise.

In the plane of tan θ about the peak, of the half vector's θh or of θr, the density of a round lobe depends on the
radius r alone. With its cumulative distribution F(r), Green's theorem leaves an integral along the edges of the
triangle, by the azimuth φ about the peak:

    P = 1/2π ∮ F(r(φ)) dφ .

Edges of a triangle are curved in the plane of half vectors, and so are divided into segments.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.live.free_camera.normal_mapping import normalize
from relume.transport.patch_lookup import tangents_of

_ZERO, _HALF, _ONE, _TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
_PI = np.float32(math.pi)
_SEGMENTS = 4  # of an edge
_STEPS_PER_RADIAN = np.float32(4)
_MIN_COSINE = np.float32(1e-3)
_TINY = np.float32(1e-12)
_INWARD = np.float32(0.01)  # of the way to the middle of a triangle, so that shadow rays do not graze its edges


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _cumulative(quantile, angle):  # type: ignore[no-untyped-def]
    """Share of a distribution below an angle. quantile: `LobeSampling.quantile`, of which the first row counts."""
    low, high = 0, quantile.shape[1] - 1
    if angle >= quantile[0, high]:
        return _ONE
    while high - low > 1:
        middle = (low + high) // 2
        if quantile[0, middle] <= angle:
            low = middle
        else:
            high = middle
    within = (angle - quantile[0, low]) / max(quantile[0, high] - quantile[0, low], _TINY)
    return (np.float32(low) + min(max(within, _ZERO), _ONE)) / np.float32(quantile.shape[1] - 1)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _in_plane(is_half_angle, x, y, z, o):  # type: ignore[no-untyped-def]
    """Position of a direction in the plane about the peak. x, y, z: local, of any length. o: local wo. Tuples"""
    x, y, z = normalize((x, y, z))
    z = max(z, _MIN_COSINE)
    if is_half_angle:
        scale = _ONE / (z + max(o[2], _MIN_COSINE))
        return scale * (x + o[0]), scale * (y + o[1])
    mirrored = -o[0], -o[1], o[2]
    s, t = tangents_of(mirrored)
    scale = _ONE / max(x * mirrored[0] + y * mirrored[1] + z * mirrored[2], _MIN_COSINE)
    return scale * (x * s[0] + y * s[1] + z * s[2]), scale * (x * t[0] + y * t[1] + z * t[2])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _along_segment(quantile, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Integral of F dφ along a segment from (x0, y0) to (x1, y1)."""
    cross, dx, dy = x0 * y1 - x1 * y0, x1 - x0, y1 - y0
    length, height = np.float32(math.sqrt(dx * dx + dy * dy)), abs(cross)
    if height < _TINY * length or length < _TINY:
        return _ZERO
    # azimuths from the foot of the perpendicular, whose length is height / length
    begin, end = math.atan((x0 * dx + y0 * dy) / height), math.atan((x1 * dx + y1 * dy) / height)
    num, total = 1 + int(_STEPS_PER_RADIAN * (end - begin)), _ZERO
    step = np.float32(end - begin) / np.float32(num)
    for k in range(num):
        azimuth = np.float32(begin) + (np.float32(k) + _HALF) * step
        total += _cumulative(quantile, np.float32(math.atan(height / (length * math.cos(azimuth)))))
    return step * total if cross > 0 else -step * total


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def lobe_coverage(pattern, corners, o):  # type: ignore[no-untyped-def]
    """Share of a round lobe that a triangle covers.

    Args:
        pattern: `LobePattern`. corners: relative to the point, in its local frame; three tuples. o: local wo.
    Returns:
        The share, from 0 to 1. The part of the triangle below the horizon counts as if it were there.
    """
    a, b, c = corners
    if a[2] <= 0 and b[2] <= 0 and c[2] <= 0:
        return _ZERO
    total, before = _ZERO, a
    x0, y0 = _in_plane(pattern.is_half_angle, a[0], a[1], a[2], o)
    for edge in range(3):
        after = b if edge == 0 else (c if edge == 1 else a)
        for k in range(1, _SEGMENTS + 1):
            t = np.float32(k) / np.float32(_SEGMENTS)
            x1, y1 = _in_plane(
                pattern.is_half_angle, before[0] + t * (after[0] - before[0]), before[1] + t * (after[1] - before[1]),
                before[2] + t * (after[2] - before[2]), o,
            )  # fmt: skip
            total += _along_segment(pattern.quantile, x0, y0, x1, y1)
            x0, y0 = x1, y1
        before = after
    return min(abs(total) / (_TWO * _PI), _ONE)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def nearest_point(triangle, normal, position, direction):  # type: ignore[no-untyped-def]
    """Point of a triangle near a ray.

    Args:
        triangle: its corners. (3, 3) normal: unit. (3,) position: of the origin. (3,) direction: unit, a tuple.
    """
    along = height = _ZERO
    for axis in range(3):
        along += normal[axis] * direction[axis]
        height += normal[axis] * (triangle[0, axis] - position[axis])
    u = v = np.float32(1 / 3)
    if along * height > 0:
        distance = height / along
        ee = ef = ff = he = hf = _ZERO
        for axis in range(3):
            e, f = triangle[1, axis] - triangle[0, axis], triangle[2, axis] - triangle[0, axis]
            h = position[axis] + distance * direction[axis] - triangle[0, axis]
            ee, ef, ff, he, hf = ee + e * e, ef + e * f, ff + f * f, he + h * e, hf + h * f
        scale = _ONE / max(np.float64(ee) * ff - np.float64(ef) * ef, 1e-300)  # m⁴
        u, v = max(scale * (ff * he - ef * hf), _ZERO), max(scale * (ee * hf - ef * he), _ZERO)
        total = max(u + v, _ONE)
        u, v = u / total, v / total
    u, v = u + _INWARD * (np.float32(1 / 3) - u), v + _INWARD * (np.float32(1 / 3) - v)
    return (
        triangle[0, 0] + u * (triangle[1, 0] - triangle[0, 0]) + v * (triangle[2, 0] - triangle[0, 0]),
        triangle[0, 1] + u * (triangle[1, 1] - triangle[0, 1]) + v * (triangle[2, 1] - triangle[0, 1]),
        triangle[0, 2] + u * (triangle[1, 2] - triangle[0, 2]) + v * (triangle[2, 2] - triangle[0, 2]),
    )
