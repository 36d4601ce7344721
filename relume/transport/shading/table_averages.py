"""Kernels that average a term's curves over boxes in place of light triangles, with an error estimate.

Without binning, a triangle needs only the mean of its angles and their spread: a curve is averaged over a box about the
mean angle, as wide as the angle varies (first and second moments, from the edge midpoints).

Most loops write one array each: for more the compiler's vectorizer would exceed its limit of alias checks. Loops with
lookups cannot be vectorized; they do as much as possible with the loaded values.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.angles import LOBE, THETA_D, THETA_I, THETA_R, compute_angles
from relume.core.numba_options import NO_REFCOUNT

_ZERO, _HALF, _THIRD = np.float32(0), np.float32(0.5), np.float32(1 / 3)
CHUNK = 256  # triangles evaluated together: their scratch memory stays in a core's first-level cache
# Minimum half width of a box, in bands: integrals over bands are differences of larger sums.
_MIN_HALF = np.float32(0.025)
_CORNER = np.float32(1.64)
# Two moments cannot describe a peak within a box: the correction by a varying cosine is limited to this fraction, which
# is less than the error that is estimated for such a peak. A larger one could remove light that is then never refined.
_MAX_COSINE_CORRECTION = np.float32(0.5)
# A mean over a box beside a lobe may be zero, for which no relative error exists: the mean is at least this fraction of
# the curve's variation within reach, which adds up to a few millionths.
_MIN_MEAN = np.float32(1e-9)
# Relative error of a curve that varies by its own mean within a triangle's reach: about _SHAPE if the angle is linear,
# since a box is not a triangle; near an angle's pole in the ratio of reach and distance.
_SHAPE, _BEND, _MAX_BEND = np.float32(0.08), np.float32(0.05), np.float32(0.5)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _spread(gamma, num, mean, half):  # type: ignore[no-untyped-def]
    """Return mean angles of triangles, and half widths of boxes with the same variance. gamma: (3, ≥ num)"""
    a, b, c = gamma[0], gamma[1], gamma[2]
    for n in range(num):
        mean[n] = (a[n] + b[n] + c[n]) * _THIRD
    for n in range(num):
        ab, bc, ca = a[n] - b[n], b[n] - c[n], c[n] - a[n]
        # a triangle's variance, from its edge midpoints, is a ninth of this; the variance of a box is half² / 3
        half[n] = max(math.sqrt((ab * ab + bc * bc + ca * ca) * _THIRD), _MIN_HALF)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _compute_reach(kind, scale, wo, local, radius, half, num, reach):  # type: ignore[no-untyped-def]
    """Bound how far an angle varies within triangles, in bands.

    Args:
        kind: an `Angle`. scale: bands per radian. wo: times `Curve.axes`. (3,) local, radius: as in `evaluate`.
        half: from `_spread`: corners are within 1.63 half widths if the angle is linear. reach: written. (≥ num,)
    """
    if kind in (THETA_I, THETA_R, LOBE):
        for n in range(num):
            reach[n] = max(scale * radius[n], _CORNER * half[n])
    elif kind == THETA_D:
        for n in range(num):
            reach[n] = max(_HALF * scale * radius[n], _CORNER * half[n])
    else:  # the half vector rotates by half as much, or by more across the plane of wi and wo: 1 / (2 cos θd)
        x, y, z = local[0, 3], local[1, 3], local[2, 3]
        for n in range(num):
            cosine = wo[0] * x[n] + wo[1] * y[n] + wo[2] * z[n]
            half_reach = _HALF * scale * radius[n] / math.sqrt(max(_HALF + _HALF * cosine, np.float32(1e-4)))
            reach[n] = max(half_reach, _CORNER * half[n])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _ends(mean, half, last, num, low, high):  # type: ignore[no-untyped-def]
    """Return the ends of boxes, in bands. last: angle in the last band."""
    for n in range(num):
        low[n] = min(max(mean[n] - half[n], _ZERO), last - _MIN_HALF)
    for n in range(num):
        high[n] = max(min(mean[n] + half[n], last), low[n] + _MIN_HALF)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _compute_cosine_shift(gamma, mean, local, between_variance, num, cosine_shift):  # type: ignore[no-untyped-def]
    """Compute how an angle varies with cos θi between the lights of groups: covariance over mean cosine.

    Args:
        gamma, mean: as in `_spread`. local, between_variance: as in `evaluate`.
        cosine_shift: in bands, written. (≥ num,)
    """
    a, b, c = gamma[0], gamma[1], gamma[2]
    z_a, z_b, z_c = local[2, 3], local[2, 4], local[2, 5]
    for n in range(num):
        cosine = (z_a[n] + z_b[n] + z_c[n]) * _THIRD
        by_a, by_b, by_c = z_a[n] - cosine, z_b[n] - cosine, z_c[n] - cosine
        covariance = (a[n] - mean[n]) * by_a + (b[n] - mean[n]) * by_b + (c[n] - mean[n]) * by_c
        # a triangle across the horizon has no more slope than one that reaches it
        cosine_shift[n] = (
            between_variance[n]
            * covariance
            * _THIRD
            / max(cosine, abs(by_a) + abs(by_b) + abs(by_c) + np.float32(1e-6))
        )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _integrals(steps, low, high, cosine_shift, num, integral):  # type: ignore[no-untyped-def]
    """Integrate a curve times cos θi over boxes, relative to the mean cosine.

    Args:
        steps: steps of the curve, see `WholeCurves`. (≥ J, 3) low, high: from `_ends`. cosine_shift: from
            `_compute_cosine_shift`.
        integral: written. (≥ num,)
    """
    for n in range(num):
        first, final = np.uint32(low[n]), np.uint32(high[n])
        begins, ends = low[n] - np.float32(first), high[n] - np.float32(final)
        at_first, at_final = steps[first, 0], steps[final, 0]
        base = steps[first, 1] - steps[final, 1] - begins * at_first + ends * at_final
        # rise of the curve over the box times slope of the cosine: the second of the two moments
        correction, max_correction = cosine_shift[n] * (at_final - at_first), _MAX_COSINE_CORRECTION * abs(base)
        integral[n] = base + min(max(correction, -max_correction), max_correction)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _means(low, high, num, value):  # type: ignore[no-untyped-def]
    """Divide integrals over boxes by their widths."""
    for n in range(num):
        value[n] /= high[n] - low[n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _variations(steps, mean, reach, last, num, variation):  # type: ignore[no-untyped-def]
    """Compute the variation of a curve within reach of mean angles.

    Args:
        steps: as in `_integrals`. mean, reach: in bands. last: angle in the last band. variation: written.
    """
    for n in range(num):
        first, final = np.uint32(max(mean[n] - reach[n], _ZERO)), np.uint32(min(mean[n] + reach[n], last))
        variation[n] = steps[first, 2] - steps[final, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_errors(mean, reach, variation, value, num, error):  # type: ignore[no-untyped-def]
    """Add the relative errors of a curve's averages over boxes.

    Args:
        mean, reach, variation: as in `_variations`. value: the averages, raised to the minimum for relative errors.
        error: added to. (≥ num,) each
    """
    for n in range(num):
        value[n] = max(value[n], _MIN_MEAN * variation[n])
    for n in range(num):
        bend = min(_BEND * reach[n] / max(mean[n], np.float32(1e-6)), _MAX_BEND)
        error[n] += (_SHAPE + bend) * variation[n] / max(value[n], np.float32(1e-30))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _multiply(factor, num, value):  # type: ignore[no-untyped-def]
    for n in range(num):
        value[n] *= factor[n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def evaluate(curves, wo, local, radius, between_variance, num, scratch, value, error):  # type: ignore[no-untyped-def]
    """Multiply the averages of all curves over triangles.

    Args:
        curves: `WholeCurves`. wo: times `Curve.axes`, one for each curve. (C, 3)
        local: corners and edge midpoints; only the midpoints are read. (3 axes, 6, ≥ num)
        radius: of the triangles, radians. (≥ num,)
        between_variance: of groups, variance between their lights, each with one cos θi; empty for individual lights.
            (≥ num,)
        scratch: (11, ≥ num). value: written. (1 or 3, ≥ num) error: relative, written. (≥ num,)
    """
    kinds, _, scale, steps, num_rows = curves
    gamma, mean, half, reach, low = scratch[:3], scratch[3], scratch[4], scratch[5], scratch[6]
    high, curve_mean, variation, cosine_shift = scratch[7], scratch[8], scratch[9], scratch[10]
    value[:, :num] = 1
    error[:num] = 0
    cosine_shift[:num] = 0
    for k in range(kinds.shape[0]):
        for node in range(3):
            compute_angles(
                kinds[k], scale[k], local[0, 3 + node, :num], local[1, 3 + node, :num], local[2, 3 + node, :num],
                wo[k, 0], wo[k, 1], wo[k, 2], gamma[node],
            )  # fmt: skip
        last = scale[k] * np.float32(math.pi / 2 * (1 - 1e-6))
        _spread(gamma, num, mean, half)
        _compute_reach(kinds[k], scale[k], wo[k], local, radius, half, num, reach)
        _ends(mean, half, last, num, low, high)
        if between_variance.shape[0]:
            _compute_cosine_shift(gamma, mean, local, between_variance, num, cosine_shift)
        for row in range(value.shape[0]):
            if row < num_rows[k]:
                _integrals(steps[k, row], low, high, cosine_shift, num, curve_mean)
                _means(low, high, num, curve_mean)
                _variations(steps[k, row], mean, reach, last, num, variation)
                _add_errors(mean, reach, variation, curve_mean, num, error)
            _multiply(curve_mean, num, value[row])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def load_nodes(nodes, node, light, x, y, z):  # type: ignore[no-untyped-def]
    """Look up a node of listed lights.

    Args:
        nodes: of all lights. (M, 6, 3) node: its index. light: listed lights. (num,) x, y, z: written. (≥ num,) each
    """
    for k in range(light.shape[0]):
        m = np.uint32(light[k])
        x[k], y[k], z[k] = nodes[m, node, 0], nodes[m, node, 1], nodes[m, node, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def load_midpoints(nodes, light, local):  # type: ignore[no-untyped-def]
    """Look up the edge midpoints of listed lights. nodes, light: as in `load_nodes`. local: written. (3, 6, ≥ num)"""
    ab_x, bc_x, ca_x = local[0, 3], local[0, 4], local[0, 5]
    ab_y, bc_y, ca_y = local[1, 3], local[1, 4], local[1, 5]
    ab_z, bc_z, ca_z = local[2, 3], local[2, 4], local[2, 5]
    for k in range(light.shape[0]):  # not vectorizable in any order: load all of a light, which is contiguous
        m = np.uint32(light[k])
        ab_x[k], ab_y[k], ab_z[k] = nodes[m, 3, 0], nodes[m, 3, 1], nodes[m, 3, 2]
        bc_x[k], bc_y[k], bc_z[k] = nodes[m, 4, 0], nodes[m, 4, 1], nodes[m, 4, 2]
        ca_x[k], ca_y[k], ca_z[k] = nodes[m, 5, 0], nodes[m, 5, 1], nodes[m, 5, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def rotate_nodes(n, t, first_node, num, local):  # type: ignore[no-untyped-def]
    """Rotate nodes [first_node, 6) into the frame of normal n and tangent t. local: (3, 6, ≥ num)"""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    tx, ty, tz, nx, ny, nz = t[0], t[1], t[2], n[0], n[1], n[2]
    for node in range(first_node, 6):
        a, b, c = local[0, node], local[1, node], local[2, node]
        for k in range(num):
            x, y, z = a[k], b[k], c[k]
            a[k] = tx * x + ty * y + tz * z
            b[k] = bx * x + by * y + bz * z
            c[k] = nx * x + ny * y + nz * z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def load_weights(irradiance_radius, light, shading, weight, radius):  # type: ignore[no-untyped-def]
    """Look up irradiance and radius of listed lights.

    Args:
        irradiance_radius: irradiance, radius. (M, 4) light: (num,). shading: q cos θi. (1 or 3, num)
        weight: irradiance · q cos θi, written. (3, ≥ num) radius: written. (≥ num,)
    """
    blue_row = shading.shape[0] - 1
    red, green, blue = weight[0], weight[1], weight[2]
    for k in range(light.shape[0]):
        m = np.uint32(light[k])
        red[k] = irradiance_radius[m, 0] * shading[0, k]
        green[k] = irradiance_radius[m, 1] * shading[blue_row // 2, k]
        blue[k] = irradiance_radius[m, 2] * shading[blue_row, k]
        radius[k] = irradiance_radius[m, 3]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def sum_up(value, weight, num, total):  # type: ignore[no-untyped-def]
    """Add weight (3, ≥ num) times value (1 or 3, ≥ num) to the total (3,)."""
    blue_row = value.shape[0] - 1
    for channel in range(3):
        channel_weight, factor, channel_total = weight[channel], value[blue_row * channel // 2], np.float32(0)
        for n in range(num):
            channel_total += channel_weight[n] * factor[n]
        total[channel] += channel_total
