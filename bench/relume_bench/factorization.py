"""factorization.*: number of terms of the factorization ρ(ωi, ωo) = Σ_k σ_k h_k(ωo) g_k(ωi) of a BRDF, by its SVD.

The laws of Mahajan, Tseng and Ramamoorthi 2008: 2.5 s for Phong's exponent s, and a constant over σ² for the half-angle
Gaussian of Torrance and Sparrow (eq. 14). The norm is theirs: 99 % of the energy, both directions on the hemisphere,
uniform in solid angle, no cosine. That is 10 % RMS; `terms_for_2_percent` is the number for 2 % RMS.

An isotropic BRDF depends on φi − φo only, so its SVD splits into one for each frequency m of that angle; those with m >
0 count twice, as cosine and as sine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from relume_bench.figure import Figure

F64 = NDArray[np.float64]
Brdf = Callable[[F64, F64], F64]
"""Functions of cosines: of the angle to the mirror direction, of the half angle."""

ENERGY = 0.99
EXPONENTS, SIGMAS = (10.0, 20.0, 30.0, 60.0, 100.0), (0.1, 0.15, 0.2, 0.3)


def measure(tiny: bool) -> list[Figure]:
    """Count terms for a range of exponents and widths, and fit both laws by least squares through the origin."""
    size = 24 if tiny else 160
    phong = [_energies(_phong(s), size) for s in EXPONENTS]
    half = [_energies(_torrance_sparrow(sigma), size) for sigma in SIGMAS]
    by_exponent = [_count(energies, ENERGY) for energies in phong]
    by_sigma = [_count(energies, ENERGY) for energies in half]
    details = {"norm": "99 % of the energy, visible hemispheres, no cosine", "angles": size}
    return [
        Figure(
            "factorization.phong_terms_per_exponent",
            _slope(EXPONENTS, by_exponent),
            "terms",
            {
                **details,
                "exponents": list(EXPONENTS),
                "terms": by_exponent,
                "terms_for_2_percent": [_count(energies, 1 - 0.02**2) for energies in phong],
            },
        ),
        Figure(
            "factorization.torrance_sparrow_terms_sigma2",
            _slope([1 / sigma**2 for sigma in SIGMAS], by_sigma),
            "terms · σ²",
            {
                **details,
                "sigmas": list(SIGMAS),
                "terms": by_sigma,
                "terms_for_2_percent": [_count(energies, 1 - 0.02**2) for energies in half],
            },
        ),
    ]


def _phong(exponent: float) -> Brdf:
    return lambda cos_mirror, cos_half: np.maximum(cos_mirror, 0) ** exponent


def _torrance_sparrow(sigma: float) -> Brdf:
    return lambda cos_mirror, cos_half: np.exp(-((np.arccos(np.minimum(cos_half, 1)) / sigma) ** 2))


def _energies(brdf: Brdf, size: int) -> F64:
    """Squared singular values, largest first. size: zenith angles of either direction, by Gauss–Legendre."""
    node, weight = np.polynomial.legendre.leggauss(size)
    cosine, weight = (node + 1) / 2, weight / 2  # of the zenith angle, uniform in solid angle
    sine, azimuth = np.sqrt(1 - cosine**2), np.pi * (np.arange(2 * size) + 0.5) / (2 * size)
    level = np.outer(cosine, cosine)[:, :, None]
    across = np.outer(sine, sine)[:, :, None] * np.cos(azimuth)
    cos_half = (cosine[:, None] + cosine)[:, :, None] / np.sqrt(np.maximum(2 * (1 + level + across), 1e-12))
    values = brdf(level - across, cos_half) * np.sqrt(np.outer(weight, weight))[:, :, None]
    energies_by_frequency = []
    for m in range(size):
        fourier_coefficients = (values @ np.cos(m * azimuth)) / len(azimuth)
        squared_singular_values = np.linalg.svd(fourier_coefficients, compute_uv=False) ** 2
        energies_by_frequency.append(squared_singular_values if m == 0 else np.repeat(squared_singular_values, 2))
    return np.sort(np.concatenate(energies_by_frequency))[::-1]


def _count(energies: F64, energy_fraction: float) -> int:
    return int(np.searchsorted(np.cumsum(energies), energy_fraction * energies.sum()) + 1)


def _slope(x: Sequence[float], y: Sequence[int]) -> float:
    along = np.asarray(x)
    return float(along @ np.asarray(y, np.float64) / (along @ along))
