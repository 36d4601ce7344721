"""Two-lobe mixture of a highlight: two von Mises–Fisher distributions, fitted by maximum likelihood.

    f(ωi) = Σ_n s_n κ_n e^(−κ_n (1 − ω_n · ωi)) / (2π (1 − e^(−2 κ_n))),   σ_n² = 1 / κ_n

Microfacet highlights have a core and a wide tail, and at grazing angles they are longer in the plane of incidence than
across it: two lobes of different widths represent both. They are fitted by expectation maximization (Banerjee et al.
2005, *Clustering on the Unit Hypersphere using von Mises-Fisher Distributions*), always from the same start: tables
over θo are interpolated, and should change continuously with edits.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_PARAMETERS = 5  # cos θ of both, s_1, both σ
_NUM_ITERATIONS = 12
_INITIAL_OFFSET = 0.5  # of σ, initial distance of each lobe from the center
_NARROWEST, _WIDEST = np.float32(1e-8), np.float32(1.0)  # σ²


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _responsibility(x):  # type: ignore[no-untyped-def]
    """Return 1 / (1 + e^x), to 1e-4, by Lambert's continued fraction of the hyperbolic tangent, which vectorizes."""
    h = min(max(np.float32(-0.5) * x, np.float32(-4.9)), np.float32(4.9))
    q = h * h
    numerator = h * (np.float32(135135) + q * (np.float32(17325) + q * (np.float32(378) + q)))
    denominator = np.float32(135135) + q * (np.float32(62370) + q * (np.float32(3150) + q * np.float32(28)))
    return np.float32(0.5) + np.float32(0.5) * numerator / denominator


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _squared_width(length):  # type: ignore[no-untyped-def]
    """Return σ² = 1 / κ from the length of the mean direction, R: κ ≈ R (3 − R²) / (1 − R²)."""
    r = min(max(length, np.float32(1e-3)), np.float32(1 - 1e-7))
    return min(max((np.float32(1) - r * r) / (r * (np.float32(3) - r * r)), _NARROWEST), _WIDEST)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _fit(x, z, area, brdf_cosine, start, stop, out):  # type: ignore[no-untyped-def]
    """Fit the rows [start, stop). out: (rows, `NUM_PARAMETERS`)"""
    num = x.shape[1]
    weight = np.empty(num, np.float32)
    for row in range(start, stop):
        total = squared_total = np.float32(0)
        along_x = along_z = squared_x = squared_z = np.float32(0)
        for k in range(num):
            weight[k] = brdf_cosine[row, k] * area[k]
            squared_weight = brdf_cosine[row, k] * weight[k]
            total += weight[k]
            along_x += weight[k] * x[row, k]
            along_z += weight[k] * z[row, k]
            squared_total += squared_weight
            squared_x += squared_weight * x[row, k]
            squared_z += squared_weight * z[row, k]
        out[row, 0] = out[row, 1] = out[row, 3] = out[row, 4] = 1
        out[row, 2] = 0.5
        if not squared_total > 0:
            continue
        inverse_total = np.float32(1) / total
        along_x, along_z = along_x * inverse_total, along_z * inverse_total
        # the square of a density is narrower by √½
        variance = max(
            np.float32(2) - np.float32(2) * math.sqrt(squared_x * squared_x + squared_z * squared_z) / squared_total,
            _NARROWEST,
        )
        middle, off = math.atan2(squared_x, squared_z), np.float32(_INITIAL_OFFSET) * math.sqrt(variance)
        first: Any = np.float32(0.5)
        variance_1: Any = variance / np.float32(1.5)
        variance_2: Any = variance / np.float32(0.75)
        x_1, z_1 = math.sin(middle + off), math.cos(middle + off)
        x_2, z_2 = math.sin(middle - off), math.cos(middle - off)
        for _ in range(_NUM_ITERATIONS):
            kappa_1, kappa_2 = np.float32(1) / variance_1, np.float32(1) / variance_2
            peak_1 = first * kappa_1 / (np.float32(1) - math.exp(np.float32(-2) * kappa_1))
            peak_2 = (np.float32(1) - first) * kappa_2
            peak_2 /= np.float32(1) - math.exp(np.float32(-2) * kappa_2)
            log_ratio = np.float32(math.log(peak_2 / peak_1)) + kappa_1 - kappa_2
            gradient_x, gradient_z = kappa_2 * x_2 - kappa_1 * x_1, kappa_2 * z_2 - kappa_1 * z_1
            responsibility_sum = mean_x = mean_z = np.float32(0)
            for k in range(num):
                responsibility = (
                    inverse_total
                    * weight[k]
                    * _responsibility(log_ratio + gradient_x * x[row, k] + gradient_z * z[row, k])
                )
                responsibility_sum += responsibility
                mean_x += responsibility * x[row, k]
                mean_z += responsibility * z[row, k]
            first = min(max(responsibility_sum, np.float32(1e-3)), np.float32(1 - 1e-3))
            remainder_x, remainder_z = along_x - mean_x, along_z - mean_z
            length: Any = max(np.float32(math.hypot(mean_x, mean_z)), np.float32(1e-12))
            remainder_length: Any = max(np.float32(math.hypot(remainder_x, remainder_z)), np.float32(1e-12))
            x_1, z_1, variance_1 = mean_x / length, mean_z / length, _squared_width(length / first)
            x_2, z_2 = remainder_x / remainder_length, remainder_z / remainder_length
            variance_2 = _squared_width(remainder_length / (np.float32(1) - first))
        out[row, 0] = min(max(z_1, np.float32(0)), np.float32(1)) if x_1 > 0 else np.float32(1)
        out[row, 1] = min(max(z_2, np.float32(0)), np.float32(1)) if x_2 > 0 else np.float32(1)
        out[row, 2] = first
        out[row, 3], out[row, 4] = math.sqrt(variance_1), math.sqrt(variance_2)


def fit_two_lobes(
    x: Shaped[F32, "rows n"], z: Shaped[F32, "rows n"], area: Shaped[F32, " n"], brdf_cosine: Shaped[F32, "rows n"]
) -> Shaped[F32, "rows 5"]:
    """Fit two lobes to each of some highlights that are symmetric about a plane.

    Args:
        x, z: components of directions in the plane, along the surface and along the normal.
        area: solid angle of each. brdf_cosine: f cos θi there, not negative.
    Returns:
        cos θ of both on the side of positive x, 1 beyond the normal; the weight of the first, s_1; σ of both, radians.
    """
    out = np.empty((len(x), NUM_PARAMETERS), np.float32)
    parallel_for_chunks(lambda start, stop: _fit(x, z, area, brdf_cosine, start, stop, out), len(x))
    return out
