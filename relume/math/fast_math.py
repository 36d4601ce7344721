"""Polynomials for inverse trigonometric functions and logarithms: calls of libm prevent vectorization of loops."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

_ONE, _ZERO = np.float32(1), np.float32(0)
_EPSILON, _FRACTION_PER_RADIAN = np.float32(1e-30), np.float32(0.5 / math.pi)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def acos_clamped(x):  # type: ignore[no-untyped-def]
    """Arc cosine of x clamped to [0, 1], in [0, π/2]; absolute error below 3e-7 (Abramowitz and Stegun 4.4.46)."""
    x = min(max(x, _ZERO), _ONE)
    p = np.float32(-0.0012624911)
    p = p * x + np.float32(0.0066700901)
    p = p * x - np.float32(0.0170881256)
    p = p * x + np.float32(0.0308918810)
    p = p * x - np.float32(0.0501743046)
    p = p * x + np.float32(0.0889789874)
    p = p * x - np.float32(0.2145988016)
    p = p * x + np.float32(1.5707963050)
    return p * math.sqrt(_ONE - x)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def azimuth_fraction(x, y):  # type: ignore[no-untyped-def]
    """Azimuth from the x axis divided by 2π, in [0, 1], 1 being 0; error below 1e-7 (Abramowitz and Stegun 4.4.49)."""
    across, along = abs(y), abs(x)
    t = min(across, along) / max(max(across, along), _EPSILON)
    t2 = t * t
    p = np.float32(0.0028662257)
    p = p * t2 - np.float32(0.0161657367)
    p = p * t2 + np.float32(0.0429096138)
    p = p * t2 - np.float32(0.0752896400)
    p = p * t2 + np.float32(0.1065626393)
    p = p * t2 - np.float32(0.1420889944)
    p = p * t2 + np.float32(0.1999355085)
    p = p * t2 - np.float32(0.3333314528)
    fraction = t * (_ONE + t2 * p) * _FRACTION_PER_RADIAN
    fraction = np.float32(0.25) - fraction if across > along else fraction
    fraction = np.float32(0.5) - fraction if x < 0 else fraction
    return _ONE - fraction if y < 0 and fraction > 0 else fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def fast_log2(x):  # type: ignore[no-untyped-def]
    """Base-2 logarithm of a float32 ≥ 1; error below 1e-6, exact for powers of 2.

    For a mantissa 1 + t it is t (1 + (t − 1) q(t)), with q from least squares.
    """
    bits = np.float32(x).view(np.int32)
    t = np.int32((bits & 0x7FFFFF) | 0x3F800000).view(np.float32) - _ONE
    q = np.float32(0.01486540)
    q = q * t - np.float32(0.06244901)
    q = q * t + np.float32(0.12888130)
    q = q * t - np.float32(0.19509052)
    q = q * t + np.float32(0.27782506)
    q = q * t - np.float32(0.44266276)
    return np.float32((bits >> 23) - 127) + t * (_ONE + (t - _ONE) * q)
