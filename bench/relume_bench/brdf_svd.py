"""SVD of isotropic BRDFs, ρ(ωi, ωo) = Σ_k σ_k h_k(ωo) g_k(ωi), on a part of the sphere, uniform in solid angle.

Such a BRDF depends on φi − φo only, so its SVD splits into one for each frequency m of that angle; those with m > 0
count twice, as cosine and as sine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]

SPHERE, HEMISPHERE = -1.0, 0.0  # least cosines of both zenith angles


class Angles(NamedTuple):
    """Cosines between two directions, which broadcast: to the normal, from ωi to the mirror direction of ωo, of the
    half angle, and of the difference angle.
    """

    incident: F64
    outgoing: F64
    mirror: F64
    half: F64
    difference: F64


Brdf = Callable[[Angles], F64]


class Zenith(NamedTuple):
    """Quadrature over the cosine of the zenith angle; `weight` is uniform in solid angle, without the azimuth."""

    cosine: Shaped[F64, " n"]
    weight: Shaped[F64, " n"]


class Frequency(NamedTuple):
    """Factors of one frequency m.

    Attributes:
        m: the frequency. values: σ_k.
        outgoing, incident: h_k and g_k at the zenith angles, orthonormal with the weights, times cos mφ or sin mφ,
            orthonormal over φ.
    """

    m: int
    values: Shaped[F64, " k"]
    outgoing: Shaped[F64, "n k"]
    incident: Shaped[F64, "n k"]


def gauss_zenith(size: int, least: float = HEMISPHERE) -> Zenith:
    """Gauss–Legendre quadrature from a least cosine to 1."""
    node, weight = np.polynomial.legendre.leggauss(size)
    return Zenith(least + (1 - least) * (node + 1) / 2, (1 - least) / 2 * weight)


def angles_between(incident: F64, outgoing: F64, azimuth: F64) -> Angles:
    """Return the cosines of Angles.

    Args:
        incident, outgoing: cos θi and cos θo. azimuth: φi − φo. All broadcast.
    """
    level = incident * outgoing
    across = np.sqrt((1 - incident**2) * (1 - outgoing**2)) * np.cos(azimuth)
    length = np.sqrt(np.maximum(2 * (1 + level + across), 1e-12))
    half = np.clip((incident + outgoing) / length, -1, 1)
    return Angles(incident, outgoing, level - across, half, np.minimum(length / 2, 1))


def fourier_rows(
    brdf: Brdf, outgoing: Shaped[F64, " n"], zenith: Zenith, num_azimuths: int
) -> Shaped[F64, "n zenith frequencies"]:
    """Return 2π times the Fourier coefficients of a BRDF over φi − φo, for as many frequencies as zenith angles.

    Args:
        brdf: without the cosine. outgoing: cos θo. zenith: quadrature over θi.
        num_azimuths: over half of the circle.
    """
    azimuth = np.pi * (np.arange(num_azimuths) + 0.5) / num_azimuths  # half of the circle
    values = brdf(angles_between(zenith.cosine[:, None], outgoing[:, None, None], azimuth))
    frequencies = np.arange(min(num_azimuths, len(zenith.cosine)))
    cosine = np.cos(np.outer(azimuth, frequencies)) * (2 * np.pi / num_azimuths)
    return np.asarray(np.broadcast_to(values, (len(outgoing), len(zenith.cosine), num_azimuths)) @ cosine)


def factorize(brdf: Brdf, zenith: Zenith, num_azimuths: int | None = None) -> list[Frequency]:
    """Return the SVD of a BRDF by frequency.

    Args:
        brdf: without the cosine. zenith: quadrature over both angles.
        num_azimuths: over half of the circle; None: twice the zenith angles.
    """
    rows = fourier_rows(brdf, zenith.cosine, zenith, num_azimuths or 2 * len(zenith.cosine))
    root = np.sqrt(zenith.weight)
    out = []
    for m, matrix in enumerate(np.moveaxis(rows, -1, 0) * np.outer(root, root)):
        left, values, right = np.linalg.svd(matrix)
        out.append(Frequency(m, values, left / root[:, None], right.T / root[:, None]))
    return out


def singular_values(factors: list[Frequency]) -> F64:
    """Return all σ_k, largest first, those of m > 0 twice."""
    values = [np.repeat(each.values, 1 if each.m == 0 else 2) for each in factors]
    return np.sort(np.concatenate(values))[::-1]


def count_terms(values: F64, energy: float = 0.99) -> int:
    """Return the number of terms with a share of the energy. values: σ_k, largest first"""
    squares = values**2
    return int(np.searchsorted(np.cumsum(squares), energy * squares.sum()) + 1)


def phong(exponent: float) -> Brdf:
    """Phong's lobe with unit integral over the sphere (eq. 5)."""
    return lambda angles: (exponent + 1) / (2 * np.pi) * np.maximum(angles.mirror, 0) ** exponent


def half_angle_gaussian(sigma: float) -> Brdf:
    """Torrance and Sparrow's lobe without shadowing and Fresnel (eq. 14)."""
    return lambda angles: np.exp(-((np.arccos(angles.half) / sigma) ** 2)) / (4 * np.pi * sigma**2)


def zonal_coefficients(lobe: Callable[[F64], F64], num: int, least: float = -1.0) -> F64:
    """Return F_l = 2π ∫ f(x) P_l(x) dx, the eigenvalues of a lobe over the sphere (Funk–Hecke).

    Args:
        lobe: f of the cosine. num: number of degrees. least: cosine below which it is zero.
    """
    zenith = gauss_zenith(max(512, 2 * num), least)
    polynomials = np.polynomial.legendre.legvander(zenith.cosine, num - 1)
    return np.asarray(2 * np.pi * (zenith.weight * lobe(zenith.cosine)) @ polynomials)


def frequency_content(coefficients: F64, energy: float = 0.99) -> int:
    """Return l*: degrees up to it have a share of the energy, Σ (2l + 1) F_l². coefficients: F_l"""
    squares = (2 * np.arange(len(coefficients)) + 1) * coefficients**2
    return int(np.searchsorted(np.cumsum(squares), energy * squares.sum()))
