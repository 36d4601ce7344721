"""factorization.*: number of terms of the factorization ρ(ωi, ωo) = Σ_k σ_k h_k(ωo) g_k(ωi) of a BRDF, by its SVD.

The laws of Mahajan, Tseng and Ramamoorthi 2008: over the hemispheres 2.5 s for Phong's exponent s, over the sphere 5 to
6 s, and a constant over σ² for the half-angle Gaussian of Torrance and Sparrow (eq. 14). The norm is theirs: 99 % of
the energy, uniform in solid angle, no cosine. That is 10 % RMS; `terms_for_2_percent` is the number for 2 % RMS.

`factorization.sphere_eigenvalues`: σ_k over the sphere against F_l in closed form, 2l + 1 times each (Fig. 2), largest
difference in units of F_0; `least_overlap` is that of a factor with its spherical harmonic.
`factorization.hemisphere_eigenvalues`: σ_k over the hemispheres against F_l, l + 1 times each (Fig. 5), RMS relative to
theirs; `even_share` is the energy of a factor that one harmonic with even l + m has, mean of the first 28 (Fig. 4).

The half-angle Gaussian has 72 terms at σ = 0.2, where the paper says "about 60". `paper_grid` counts them on its grid,
40 angles each; `to_80_degrees` leaves out the last ten degrees above the horizon, whose ever narrower lobes take a
third of the terms.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import sph_legendre_p

from relume_bench.brdf_svd import (
    SPHERE,
    Brdf,
    Frequency,
    angles_between,
    count_terms,
    factorize,
    gauss_zenith,
    half_angle_gaussian,
    phong,
    singular_values,
    zonal_coefficients,
)
from relume_bench.figure import Figure

F64 = NDArray[np.float64]

EXPONENTS, SIGMAS = (10.0, 20.0, 30.0, 60.0, 100.0), (0.1, 0.15, 0.2, 0.3, 0.4)
_TWO_PERCENT = 1 - 0.02**2
_PAPER_ANGLES = 40
_NUM_MODES = 28  # of hemispheres: l up to 6


def measure(tiny: bool) -> list[Figure]:
    """Count terms for a range of exponents and widths, fit the laws, and compare factors with harmonics."""
    size = 24 if tiny else 160
    details = {"norm": "99 % of the energy, visible hemispheres, no cosine", "angles": size}
    phong_values = [_values(phong(s), size) for s in EXPONENTS]
    half_values = [_values(half_angle_gaussian(sigma), size) for sigma in SIGMAS]
    terms, half_terms = ([count_terms(values) for values in each] for each in (phong_values, half_values))
    phong_context = {
        "exponents": list(EXPONENTS),
        "terms": terms,
        "terms_for_2_percent": [count_terms(values, _TWO_PERCENT) for values in phong_values],
    }
    half_context = {
        "sigmas": list(SIGMAS),
        "terms": half_terms,
        "terms_for_2_percent": [count_terms(values, _TWO_PERCENT) for values in half_values],
        "paper_grid": [count_on_paper_grid(half_angle_gaussian(sigma)) for sigma in SIGMAS],
        "to_80_degrees": [_terms_to_80_degrees(half_angle_gaussian(sigma), size) for sigma in SIGMAS],
    }
    half_law = _slope([1 / sigma**2 for sigma in SIGMAS], half_terms)
    return [
        Figure(
            "factorization.phong_terms_per_exponent", _slope(EXPONENTS, terms), "terms", {**details, **phong_context}
        ),
        Figure("factorization.torrance_sparrow_terms_sigma2", half_law, "terms · σ²", {**details, **half_context}),
        *_sphere_figures(24 if tiny else 64),
        _hemisphere_figure(phong_values[EXPONENTS.index(30.0)], size),
    ]


def _values(brdf: Brdf, size: int) -> F64:
    return singular_values(factorize(brdf, gauss_zenith(size)))


def _terms_to_80_degrees(brdf: Brdf, size: int) -> int:
    return count_terms(singular_values(factorize(brdf, gauss_zenith(size, float(np.cos(np.radians(80)))))))


def count_on_paper_grid(brdf: Brdf) -> int:
    """Return the number of terms on the grid of the paper: 40 cosines and 40 azimuths of each direction."""
    cosine = (np.arange(_PAPER_ANGLES) + 0.5) / _PAPER_ANGLES
    azimuth = 2 * np.pi * np.arange(_PAPER_ANGLES) / _PAPER_ANGLES
    values = brdf(angles_between(cosine[:, None], cosine[:, None, None], azimuth))
    spectrum = np.fft.fft(values, axis=-1).real  # the matrix is circulant in the azimuths
    each = [np.linalg.svd(spectrum[..., m], compute_uv=False) for m in range(_PAPER_ANGLES)]
    return count_terms(np.sort(np.concatenate(each))[::-1])


def _lobe_coefficients(exponent: float, num: int) -> F64:
    """F_l of Phong's lobe, normalized as `phong`."""
    return zonal_coefficients(lambda x: (exponent + 1) / (2 * np.pi) * x**exponent, num, 0.0)


def _sphere_figures(size: int) -> list[Figure]:
    num_degrees = size // 2
    differences, overlaps, terms = [], [], []
    for exponent in EXPONENTS:
        factors = factorize(phong(exponent), gauss_zenith(size, SPHERE))
        values, expected = singular_values(factors), _lobe_coefficients(exponent, num_degrees)
        repeated = np.sort(np.repeat(expected, 2 * np.arange(num_degrees) + 1))[::-1]
        terms.append(count_terms(values))
        num = min(terms[-1], len(repeated))
        differences.append(float(np.abs(values[:num] - repeated[:num]).max() / expected[0]))
        overlaps.append(_least_overlap(factors, gauss_zenith(size, SPHERE).weight, size))
    context = {"exponents": list(EXPONENTS), "angles": size, "terms": terms}
    return [
        Figure(
            "factorization.sphere_eigenvalues", max(differences), "of F_0", {**context, "least_overlap": min(overlaps)}
        ),
        Figure("factorization.sphere_terms_per_exponent", _slope(EXPONENTS, terms), "terms", context),
    ]


def harmonic(degree: int, m: int, cosine: F64) -> F64:
    """Return the part of Y_lm over the zenith angle, orthonormal over the sphere with an orthonormal part over φ.

    Args:
        degree, m: l and m. cosine: cos θ.
    """
    return np.asarray(np.sqrt(2 * np.pi) * sph_legendre_p(degree, m, np.arccos(cosine))[0])


def _least_overlap(factors: list[Frequency], weight: F64, size: int) -> float:
    """Return the least |∫ g_k Y_lm| of the factors up to degree 6."""
    cosine = gauss_zenith(size, SPHERE).cosine
    return min(
        float(abs(np.sum(weight * each.incident[:, k] * harmonic(each.m + k, each.m, cosine))))
        for each in factors[:7]
        for k in range(7 - each.m)
    )


def _hemisphere_figure(values: F64, size: int) -> Figure:
    exponent, num = 30.0, count_terms(values)
    expected = _lobe_coefficients(exponent, 40)
    repeated = np.sort(np.repeat(expected, np.arange(40) + 1))[::-1][:num]
    rms = float(np.sqrt(np.mean((values[:num] - repeated) ** 2) / np.mean(repeated**2)))
    zenith = gauss_zenith(size)
    factors = factorize(phong(exponent), zenith)
    modes = sorted(((value, each, k) for each in factors for k, value in enumerate(each.values)), key=lambda x: -x[0])
    shares = []
    for _, each, k in modes[:_NUM_MODES]:
        # harmonics with even l + m are orthogonal over the hemisphere too, with half of the energy
        even = [np.sqrt(2) * harmonic(each.m + 2 * j, each.m, zenith.cosine) for j in range(6)]
        shares.append(max(float(np.sum(zenith.weight * each.incident[:, k] * mode)) ** 2 for mode in even))
    context = {"exponent": exponent, "terms": num, "angles": size, "even_share": float(np.mean(shares))}
    context |= {"eigenvalues": (values[:21] / values[0]).tolist(), "f_l": (repeated[:21] / repeated[0]).tolist()}
    return Figure("factorization.hemisphere_eigenvalues", 100 * rms, "%", context)


def _slope(x: Sequence[float], y: Sequence[int]) -> float:
    along = np.asarray(x)
    return float(along @ np.asarray(y, np.float64) / (along @ along))
