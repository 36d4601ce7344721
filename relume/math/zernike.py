"""The in-basis: Zernike's polynomials, orthonormal over the hemisphere weighed by its cosine.

A direction (x, y, z) above a surface is a place (x, y) of the unit disc, and dx dy = cos θ dω. What is orthonormal on
the disc keeps most of a BRDF by its cosine-weighted error:

    h_nm(ω) = N_nm · (Re | Im)(x + iy)^m · P_s^(0,m)(2 (x² + y²) − 1),   s = (n − m) / 2,   N² = (n + 1) (1 or 2) / π

with Jacobi's polynomials P. They are nested: those of degree n ≤ N are the first (N + 1)(N + 2) / 2
(docs/free-camera.md#the-zernike-basis).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

DEGREE = 7
OUTGOING_DEGREE = 6  # of those by which surfaces send light to each other
FAST_DEGREE = 4  # of those in which light is followed while a hand moves it
NUM_FUNCTIONS = (DEGREE + 1) * (DEGREE + 2) // 2  # K
DEGREES = np.repeat(np.arange(DEGREE + 1), np.arange(DEGREE + 1) + 1)
"""Degree of each function. (K,)"""
WINDOW_DECAY = 1 / (2 * 8.0**2)
"""1 / 2d², d = 8, of windows e^(−n (n + 2) / 2d²). Functions cut off at a degree ring beside what is bright; a window
takes a part of that away for a little blur (docs/free-camera.md#highlights, docs/indirect-light.md#bounces)."""
BATCH_RAYS = 128  # rays that `add_light` takes; all columns of them stay in the first cache
WI, LIGHT, _X, _RE, _IM, _BEFORE, _LAST, NUM_COLUMNS = 0, *(BATCH_RAYS * k for k in (2, 5, 6, 7, 8, 9)), 10
"""Where the columns of `add_light` begin, and how many there are."""


class Recurrence(NamedTuple):
    """How functions follow from each other; one rung for each degree n and order m ≥ 0, orders outermost.

    Attributes:
        order: m. (rungs,) int32. norm: N. (rungs,) float32
        cosine, sine: which of the K functions its two parts are; the same where m is 0. (rungs,) int32
        a, b, c: P_s = (a · x + b) P_(s−1) − c P_(s−2), with P_0 = 1; `a` is 0 where s is. (rungs,) float32
    """

    order: NDArray[np.int32]
    norm: F32
    cosine: NDArray[np.int32]
    sine: NDArray[np.int32]
    a: F32
    b: F32
    c: F32


def num_functions(degree: int) -> int:
    """How many functions have at most a degree."""
    return (degree + 1) * (degree + 2) // 2


@lru_cache(maxsize=DEGREE + 1)
def recurrence(degree: int = DEGREE) -> Recurrence:
    """The rungs of all functions up to a degree, at most `DEGREE`."""
    rows: list[tuple[float, ...]] = []
    for m in range(degree + 1):
        for s, n in enumerate(range(m, degree + 1, 2)):
            first = num_functions(n - 1) + sum(1 if k == 0 else 2 for k in range(n % 2, m, 2))
            scale = math.sqrt((n + 1) * (2 if m else 1) / math.pi)
            rows.append((m, scale, first, first + (1 if m else 0), *_recurrence(s, m)))
    table = np.array(rows)
    order, cosine, sine = (np.ascontiguousarray(table[:, k], np.int32) for k in (0, 2, 3))
    norm, a, b, c = (np.ascontiguousarray(table[:, k], np.float32) for k in (1, 4, 5, 6))
    return Recurrence(order=order, norm=norm, cosine=cosine, sine=sine, a=a, b=b, c=c)


def _recurrence(s: int, m: int) -> tuple[float, float, float]:
    """Find the factors a, b, c of `Recurrence` for P_s^(0,m)."""
    if s == 0:
        return 0.0, 0.0, 0.0
    if s == 1:
        return (m + 2) / 2, -m / 2, 0.0
    t = 2 * s + m
    divisor = 2 * s * (s + m) * (t - 2)
    return (t - 1) * t * (t - 2) / divisor, -(t - 1) * m * m / divisor, 2 * (s - 1) * (s + m - 1) * t / divisor


def project(wi: F64) -> F64:
    """Evaluate all functions.

    Args:
        wi: local directions, unit, z = normal. (..., 3)
    Returns:
        (..., K) float64, zero below the horizon
    """
    table, power = recurrence(), np.ones(wi.shape[:-1], np.complex128)
    disk_point = wi[..., 0] + 1j * wi[..., 1]
    x = 2 * np.abs(disk_point) ** 2 - 1
    out = np.zeros((*wi.shape[:-1], NUM_FUNCTIONS))
    before = last = np.ones_like(x)
    for row, m in enumerate(table.order):
        if table.a[row] == 0:
            power = disk_point**m
            before, last = np.zeros_like(x), np.ones_like(x)
        else:
            before, last = last, (table.a[row] * x + table.b[row]) * last - table.c[row] * before
        value = table.norm[row] * last * power
        out[..., table.sine[row]] = value.imag
        out[..., table.cosine[row]] = value.real
    return out * (wi[..., 2:] > 0)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def accumulate(table, num, columns, out):  # type: ignore[no-untyped-def]
    """Add the light of rays to a point's light vector, t_k += Σ w h_k(ωi).

    Columns lie in one flat array at constant places: of several arrays nobody could tell that they are not the same
    memory, and loops would be of one ray at a time.

    Args:
        table: the `recurrence`. num: how many rays there are, at most `BATCH_RAYS`.
        columns: from `WI` on x and y of their local directions, from `LIGHT` on their light in each channel; the others
            are written. (NUM_COLUMNS · AT_ONCE,) float32
        out: added to. (3, K) float32
    """
    for n in range(num):
        x, y = columns[WI + n], columns[WI + BATCH_RAYS + n]
        columns[_X + n] = np.float32(2) * (x * x + y * y) - np.float32(1)
        columns[_RE + n], columns[_IM + n] = np.float32(1), np.float32(0)
    for row in range(table.order.shape[0]):
        a, b, c, m = table.a[row], table.b[row], table.c[row], table.order[row]
        if a == 0:  # the first of its order
            for n in range(num):
                columns[_BEFORE + n], columns[_LAST + n] = np.float32(0), np.float32(1)
            if m > 0:
                for n in range(num):
                    x, y, re, im = columns[WI + n], columns[WI + BATCH_RAYS + n], columns[_RE + n], columns[_IM + n]
                    columns[_RE + n], columns[_IM + n] = re * x - im * y, re * y + im * x
        else:
            for n in range(num):
                last = columns[_LAST + n]
                columns[_LAST + n] = (a * columns[_X + n] + b) * last - c * columns[_BEFORE + n]
                columns[_BEFORE + n] = last
        _add(num, columns, _RE, table.norm[row], table.cosine[row], out)
        if m > 0:
            _add(num, columns, _IM, table.norm[row], table.sine[row], out)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def evaluate_basis(table, num, wi, scratch, out):  # type: ignore[no-untyped-def]
    """Evaluate all functions for some rays.

    Args:
        table: the `recurrence`. num: how many rays there are. wi: their local directions. (≥ 2, ≥ num) float32
        scratch: (≥ 5, ≥ num) float32, written. out: written. (K, ≥ num) float32
    """
    x, re, im, before, last = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    _start_recurrence(num, wi, x)
    for row in range(table.order.shape[0]):
        _advance_recurrence(table, row, num, wi, x, re, im, before, last)
        norm, cosine, sine = table.norm[row], table.cosine[row], table.sine[row]
        for n in range(num):
            out[sine, n] = norm * last[n] * im[n]
        for n in range(num):
            out[cosine, n] = norm * last[n] * re[n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _start_recurrence(num, wi, x):  # type: ignore[no-untyped-def]
    for n in range(num):
        x[n] = np.float32(2) * (wi[0, n] * wi[0, n] + wi[1, n] * wi[1, n]) - np.float32(1)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _advance_recurrence(table, row, num, wi, x, re, im, before, last):  # type: ignore[no-untyped-def]
    """Go from the rung before to this one."""
    a, b, c = table.a[row], table.b[row], table.c[row]
    if a == 0:
        _next_power(table.order[row], num, wi, re, im)
        for n in range(num):
            before[n], last[n] = np.float32(0), np.float32(1)
    else:
        for n in range(num):
            previous = last[n]
            last[n] = (a * x[n] + b) * previous - c * before[n]
            before[n] = previous


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _next_power(m, num, wi, re, im):  # type: ignore[no-untyped-def]
    """Go from (x + iy)^(m − 1) to (x + iy)^m."""
    if m == 0:
        for n in range(num):
            re[n], im[n] = np.float32(1), np.float32(0)
        return
    for n in range(num):
        r, i = re[n], im[n]
        re[n], im[n] = r * wi[0, n] - i * wi[1, n], r * wi[1, n] + i * wi[0, n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add(num, columns, power_offset, norm, k, out):  # type: ignore[no-untyped-def]
    """Add what rays bring of function k. part: where the column of its real or imaginary power begins."""
    red = green = blue = np.float32(0)
    for n in range(num):
        value = columns[_LAST + n] * columns[power_offset + n]
        red += value * columns[LIGHT + n]
        green += value * columns[LIGHT + BATCH_RAYS + n]
        blue += value * columns[LIGHT + 2 * BATCH_RAYS + n]
    red, green, blue = norm * red, norm * green, norm * blue
    out[0, k] += red
    out[1, k] += green
    out[2, k] += blue
