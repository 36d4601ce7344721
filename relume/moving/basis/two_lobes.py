"""Two round lobes of a highlight: a mixture of two distributions of von Mises and Fisher, fitted by their likelihood.

    f(ωi) = Σ_n s_n κ_n e^(−κ_n (1 − ω_n · ωi)) / (2π (1 − e^(−2 κ_n))),   σ_n² = 1 / κ_n

Microfacets have a core and a wide skirt, and seen from aslant a highlight is longer in the plane of the eye than across
it: two lobes of a width of their own tell either. They are found by expectation and maximisation (Banerjee et al. 2005,
*Clustering on the Unit Hypersphere using von Mises-Fisher Distributions*), from the same start for all: tables over θo
are interpolated, and an edit shall change them little by little.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_NUMBERS = 5  # cos θ of both, s_1, both σ
_ROUNDS = 12
_APART = 0.5  # of σ, that each begins off the middle
_NARROWEST, _WIDEST = np.float32(1e-8), np.float32(1.0)  # σ²


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _share_of_first(x):  # type: ignore[no-untyped-def]
    """Find 1 / (1 + e^x), to 1e-4, by Lambert's continued fraction of the hyperbolic tangent: eight at once."""
    h = min(max(np.float32(-0.5) * x, np.float32(-4.9)), np.float32(4.9))
    q = h * h
    above = h * (np.float32(135135) + q * (np.float32(17325) + q * (np.float32(378) + q)))
    below = np.float32(135135) + q * (np.float32(62370) + q * (np.float32(3150) + q * np.float32(28)))
    return np.float32(0.5) + np.float32(0.5) * above / below


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _width_of(length):  # type: ignore[no-untyped-def]
    """Find σ² = 1 / κ from the length of the mean direction, R: κ ≈ R (3 − R²) / (1 − R²)."""
    r = min(max(length, np.float32(1e-3)), np.float32(1 - 1e-7))
    return min(max((np.float32(1) - r * r) / (r * (np.float32(3) - r * r)), _NARROWEST), _WIDEST)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _fit(x, z, area, sent, start, stop, out):  # type: ignore[no-untyped-def]
    """Fit the rows [start, stop). out: (rows, `NUM_NUMBERS`)"""
    num = x.shape[1]
    weight = np.empty(num, np.float32)
    for row in range(start, stop):
        total = squares = np.float32(0)
        along_x = along_z = square_x = square_z = np.float32(0)
        for k in range(num):
            weight[k] = sent[row, k] * area[k]
            square = sent[row, k] * weight[k]
            total += weight[k]
            along_x += weight[k] * x[row, k]
            along_z += weight[k] * z[row, k]
            squares += square
            square_x += square * x[row, k]
            square_z += square * z[row, k]
        out[row, 0] = out[row, 1] = out[row, 3] = out[row, 4] = 1
        out[row, 2] = 0.5
        if not squares > 0:
            continue
        per = np.float32(1) / total
        along_x, along_z = along_x * per, along_z * per
        # squares of a density are as wide as √½ of it, wherever it is bright
        variance = max(
            np.float32(2) - np.float32(2) * math.sqrt(square_x * square_x + square_z * square_z) / squares, _NARROWEST
        )
        middle, off = math.atan2(square_x, square_z), np.float32(_APART) * math.sqrt(variance)
        first: Any = np.float32(0.5)
        one: Any = variance / np.float32(1.5)
        other: Any = variance / np.float32(0.75)
        one_x, one_z = math.sin(middle + off), math.cos(middle + off)
        other_x, other_z = math.sin(middle - off), math.cos(middle - off)
        for _ in range(_ROUNDS):
            kappa, kappa_other = np.float32(1) / one, np.float32(1) / other
            peak = first * kappa / (np.float32(1) - math.exp(np.float32(-2) * kappa))
            peak_other = (np.float32(1) - first) * kappa_other
            peak_other /= np.float32(1) - math.exp(np.float32(-2) * kappa_other)
            head = np.float32(math.log(peak_other / peak)) + kappa - kappa_other
            by_x, by_z = kappa_other * other_x - kappa * one_x, kappa_other * other_z - kappa * one_z
            share = mean_x = mean_z = np.float32(0)
            for k in range(num):
                its = per * weight[k] * _share_of_first(head + by_x * x[row, k] + by_z * z[row, k])
                share += its
                mean_x += its * x[row, k]
                mean_z += its * z[row, k]
            first = min(max(share, np.float32(1e-3)), np.float32(1 - 1e-3))
            rest_x, rest_z = along_x - mean_x, along_z - mean_z
            length: Any = max(np.float32(math.hypot(mean_x, mean_z)), np.float32(1e-12))
            rest: Any = max(np.float32(math.hypot(rest_x, rest_z)), np.float32(1e-12))
            one_x, one_z, one = mean_x / length, mean_z / length, _width_of(length / first)
            other_x, other_z = rest_x / rest, rest_z / rest
            other = _width_of(rest / (np.float32(1) - first))
        out[row, 0] = min(max(one_z, np.float32(0)), np.float32(1)) if one_x > 0 else np.float32(1)
        out[row, 1] = min(max(other_z, np.float32(0)), np.float32(1)) if other_x > 0 else np.float32(1)
        out[row, 2] = first
        out[row, 3], out[row, 4] = math.sqrt(one), math.sqrt(other)


def fit_two(x: F32, z: F32, area: F32, sent: F32) -> F32:
    """Fit two lobes to each of some highlights, the same on both sides of a plane.

    Args:
        x, z: of directions, along the surface and along the normal, in the plane. (rows, n) float32
        area: solid angle of each. (n,) float32. sent: f cos θi there, not negative. (rows, n) float32
    Returns:
        cos θ of both on the side of positive x, none beyond the normal; the share of the first, s_1; σ of both,
        radians. (rows, 5) float32
    """
    out = np.empty((len(x), NUM_NUMBERS), np.float32)
    for_shares(lambda start, stop: _fit(x, z, area, sent, start, stop, out), len(x))
    return out


def fit_two_numpy(x: F64, z: F64, area: F64, sent: F64) -> F64:
    """Do as `fit_two` for one row, in plain NumPy: its oracle.

    Args:
        x, z, area, sent: as there. (n,)
    Returns:
        (5,)
    """
    weight, square = sent * area / (sent @ area), sent**2 * area / (sent**2 @ area)
    middle = np.array([square @ x, square @ z])
    variance = 2 - 2 * np.linalg.norm(middle)
    angle, off = np.arctan2(*middle), _APART * np.sqrt(variance)
    towards = np.array([[np.sin(angle + side), np.cos(angle + side)] for side in (off, -off)])
    first, width = 0.5, variance / np.array([1.5, 0.75])
    for _ in range(_ROUNDS):
        log_density = np.log(np.array([[first], [1 - first]]) / width[:, None] / (1 - np.exp(-2 / width[:, None])))
        log_density = log_density - (1 - towards @ np.array([x, z])) / width[:, None]
        its = weight / (1 + np.exp(np.minimum(log_density[1] - log_density[0], 700)))
        mean = np.array([[its @ x, its @ z], [(weight - its) @ x, (weight - its) @ z]])
        first = float(its.sum())
        length = np.linalg.norm(mean, axis=1)
        towards, r = mean / length[:, None], length / [first, 1 - first]
        width = (1 - r**2) / (r * (3 - r**2))
    cosines = np.where(towards[:, 0] > 0, np.clip(towards[:, 1], 0, 1), 1)
    return np.array([*cosines, first, *np.sqrt(width)])
