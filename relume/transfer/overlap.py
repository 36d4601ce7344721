"""How much of a triangle lies in each band of an angle: Ben-Artzi 2006, appendix A.

Only the angle at the three corners is needed: where the angle is linear over the triangle, the area below a value y grows
quadratically from the smallest corner to the middle one and from there to the largest.
"""

from __future__ import annotations

import numba as nb
import numpy as np

_ONE = np.float32(1)


@nb.njit(nogil=True, cache=True, fastmath=True, inline="always")
def sort3(a, b, c):  # type: ignore[no-untyped-def]
    """Three numbers in rising order."""
    if a > b:
        a, b = b, a
    if b > c:
        b, c = c, b
    if a > b:
        a, b = b, a
    return a, b, c


@nb.njit(nogil=True, cache=True, fastmath=True, inline="always")
def area_below(y, a, b, c):  # type: ignore[no-untyped-def]
    """Share of the triangle's area where the angle is below y; corners a ≤ b ≤ c, in bands."""
    if y >= c:
        return _ONE
    if y <= a:
        return np.float32(0)
    if y < b:
        return (y - a) * (y - a) / ((b - a) * (c - a))
    return _ONE - (c - y) * (c - y) / ((c - b) * (c - a))


@nb.njit(nogil=True, cache=True, fastmath=True)
def deposit(a, b, c, weight, out):  # type: ignore[no-untyped-def]
    """Add weight (3,) to the bands of out (3, J) in proportion to the triangle's overlap with each (eq. 22)."""
    a, b, c = sort3(a, b, c)
    last = out.shape[1] - 1
    low, high = min(int(a), last), min(int(c), last)
    below = np.float32(0)
    for j in range(low, high + 1):
        # what lies beyond the last band counts to it: angles are clamped to its end
        upto = _ONE if j == high else area_below(np.float32(j + 1), a, b, c)
        share = upto - below
        below = upto
        out[0, j] += share * weight[0]
        out[1, j] += share * weight[1]
        out[2, j] += share * weight[2]


@nb.njit(nogil=True, cache=True, fastmath=True)
def multiply_mean(a, b, c, curve, weight):  # type: ignore[no-untyped-def]
    """Multiply weight (3,) by the mean over the triangle of a curve given by its bands (3, J)."""
    a, b, c = sort3(a, b, c)
    last = curve.shape[1] - 1
    low, high = min(int(a), last), min(int(c), last)
    if low == high:
        weight[0] *= curve[0, low]
        weight[1] *= curve[1, low]
        weight[2] *= curve[2, low]
        return
    below = np.float32(0)
    red = green = blue = np.float32(0)
    for j in range(low, high + 1):
        upto = _ONE if j == high else area_below(np.float32(j + 1), a, b, c)
        share = upto - below
        below = upto
        red += share * curve[0, j]
        green += share * curve[1, j]
        blue += share * curve[2, j]
    weight[0] *= red
    weight[1] *= green
    weight[2] *= blue
