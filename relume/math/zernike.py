"""Hemispherical (Zernike) basis: Zernike polynomials, orthonormal over the hemisphere with cosine weight.

A direction (x, y, z) above a surface projects to (x, y) on the unit disk, and dx dy = cos θ dω. An orthonormal basis on
the disk therefore minimizes the cosine-weighted error of a BRDF:

    h_nm(ω) = N_nm · (Re | Im)(x + iy)^m · P_s^(0,m)(2 (x² + y²) − 1),   s = (n − m) / 2,   N² = (n + 1) (1 or 2) / π

with Jacobi polynomials P. The functions are nested: those of degree n ≤ N are the first (N + 1)(N + 2) / 2
(docs/free-camera.md#the-zernike-basis).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

DEGREE = 7
OUTGOING_DEGREE = 6  # for reflection between surfaces
FAST_DEGREE = 4  # for indirect light during a drag
NUM_FUNCTIONS = (DEGREE + 1) * (DEGREE + 2) // 2  # K
DEGREES = np.repeat(np.arange(DEGREE + 1), np.arange(DEGREE + 1) + 1)
"""Degree of each function. (K,)"""
WINDOW_DECAY = 1 / (2 * 8.0**2)
"""1 / 2d², d = 8, of windows e^(−n (n + 2) / 2d²). Truncation at a degree causes ringing around bright features; a
window removes a part of it for a little blur (docs/free-camera.md#highlights, docs/indirect-light.md#bounces).
"""
BATCH_RAYS = 128  # maximum number of rays per call of `accumulate`; all their columns fit in the L1 cache
WI, LIGHT, _X, _RE, _IM, _BEFORE, _LAST, NUM_COLUMNS = 0, *(BATCH_RAYS * k for k in (2, 5, 6, 7, 8, 9)), 10
"""Offsets of the columns of `accumulate`, and their number."""


class Recurrence(NamedTuple):
    """Recurrence table of the basis: one row for each degree n and order m ≥ 0, sorted by order.

    Attributes:
        order: m. norm: N.
        cosine, sine: basis indices of the two functions of the row; equal if m is 0.
        a, b, c: P_s = (a · x + b) P_(s−1) − c P_(s−2), with P_0 = 1; `a` is 0 if s is 0.
    """

    order: Shaped[NDArray[np.int32], " rows"]
    norm: Shaped[F32, " rows"]
    cosine: Shaped[NDArray[np.int32], " rows"]
    sine: Shaped[NDArray[np.int32], " rows"]
    a: Shaped[F32, " rows"]
    b: Shaped[F32, " rows"]
    c: Shaped[F32, " rows"]


def num_functions(degree: int) -> int:
    """Number of functions up to a degree."""
    return (degree + 1) * (degree + 2) // 2


def degree_of(num: int) -> int:
    """Highest degree whose functions are among the first `num`, at least 1 of them."""
    return (math.isqrt(8 * num + 1) - 3) // 2


@lru_cache(maxsize=DEGREE + 1)
def recurrence(degree: int = DEGREE) -> Recurrence:
    """Recurrence table of all functions up to a degree, at most `DEGREE`."""
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


@lru_cache(maxsize=1)
def recurrence_by_degree() -> Recurrence:
    """Recurrence table sorted by degree: the functions up to a degree are those of its first `num_rows` rows."""
    table = recurrence()
    by_degree = np.argsort(DEGREES[table.cosine], kind="stable")
    return Recurrence._make(field[by_degree] for field in table)


def num_rows(degree: int) -> int:
    """Number of rows of `recurrence_by_degree` up to a degree; 0 for degree −1."""
    return (degree + 2) ** 2 // 4


def _recurrence(s: int, m: int) -> tuple[float, float, float]:
    """Find the factors a, b, c of `Recurrence` for P_s^(0,m)."""
    if s == 0:
        return 0.0, 0.0, 0.0
    if s == 1:
        return (m + 2) / 2, -m / 2, 0.0
    t = 2 * s + m
    divisor = 2 * s * (s + m) * (t - 2)
    return (t - 1) * t * (t - 2) / divisor, -(t - 1) * m * m / divisor, 2 * (s - 1) * (s + m - 1) * t / divisor


def basis_functions(wi: Shaped[F64, "*batch 3"]) -> Shaped[F64, "*batch K"]:
    """Evaluate all basis functions at local unit directions, z = normal; zero below the horizon."""
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def accumulate(table, num, columns, out):  # type: ignore[no-untyped-def]
    """Add the light of rays to a point's incident radiance coefficients, t_k += Σ w h_k(ωi).

    The columns are slices of one flat array at constant offsets: with several arrays the compiler could not exclude
    aliasing and would process one ray at a time.

    Args:
        table: the `recurrence`. num: number of rays, at most `BATCH_RAYS`.
        columns: from `WI`, x and y of the local directions; from `LIGHT`, the weighted light per channel; the rest is
            scratch. (NUM_COLUMNS · BATCH_RAYS,) float32
        out: added to. (3, K) float32
    """
    for n in range(num):
        x, y = columns[WI + n], columns[WI + BATCH_RAYS + n]
        columns[_X + n] = np.float32(2) * (x * x + y * y) - np.float32(1)
        columns[_RE + n], columns[_IM + n] = np.float32(1), np.float32(0)
    for row in range(table.order.shape[0]):
        a, b, c, m = table.a[row], table.b[row], table.c[row], table.order[row]
        if a == 0:  # the first row of its order
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def evaluate_basis(table, num, wi, scratch, out):  # type: ignore[no-untyped-def]
    """Evaluate all basis functions for some rays.

    Args:
        table: the `recurrence`. num: number of rays. wi: x and y of local directions. (≥ 2, ≥ num) float32
        scratch: (≥ 5, ≥ num) float32. out: output. (K, ≥ num) float32
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
    """Advance the recurrence by one row."""
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
    """Add the rays' light times basis function k. power_offset: column of the real or imaginary power."""
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
