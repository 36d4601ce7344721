"""Properties of every BRDF term: reciprocity, finite values, energy. A new term is held to each of them.

A term that does not claim a property is named here with its reason.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.evaluate import eval_brdf
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve

F64 = NDArray[np.float64]

NOT_RECIPROCAL = {
    "measured_btf": "light and view directions are interpolated on different grids, and compressed apart",
}


def directions(rng: np.random.Generator, num: int, min_cosine: float = 0.02) -> F64:
    """Uniform unit vectors of the upper hemisphere. (num, 3)"""
    z = rng.uniform(min_cosine, 1.0, num)
    phi = rng.uniform(0, 2 * np.pi, num)
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=-1)


def assert_reciprocal(document: Mapping[str, Any], seed: int) -> None:
    """f(ωi, ωo) = f(ωo, ωi)."""
    rng = np.random.default_rng(seed)
    wi, wo = directions(rng, 300, 1e-4), directions(rng, 300, 1e-4)
    wo[:50] = wi[:50] * [-1, -1, 1] + 0.01 * rng.normal(size=(50, 3))  # near the mirror direction
    wo[:50, 2] = np.abs(wo[:50, 2]) + 1e-4
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    forward, backward = eval_brdf(document, wi, wo), eval_brdf(document, wo, wi)
    # of the tail of a lobe, 1e-30 of its peak, only the absolute error counts
    np.testing.assert_allclose(forward, backward, rtol=1e-7, atol=1e-12 * forward.max() + 1e-300)


def assert_finite_and_not_negative(document: Mapping[str, Any], seed: int) -> None:
    """0 ≤ f < ∞, also for opposite directions, and at and near the normal and the horizon; 0 below the horizon."""
    rng = np.random.default_rng(seed)
    heights = np.array([1.0, 1 - 1e-9, 0.5, 1e-3, 1e-6, 1e-9, 1e-30, 0.0, -1e-9, -0.5, -1.0])
    azimuths = np.concatenate([[0.0, np.pi / 2, np.pi], rng.uniform(0, 2 * np.pi, 3)])
    z, phi = (axis.ravel() for axis in np.meshgrid(heights, azimuths))
    s = np.sqrt(1 - z * z)
    corners = np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=-1)
    everywhere = np.concatenate([corners, directions(rng, 30, 0.0)])
    value = eval_brdf(document, everywhere[:, None], everywhere)
    assert np.isfinite(value).all()
    assert (value >= 0).all()
    below = everywhere[:, 2] <= 0
    assert not value[below].any()
    assert not value[:, below].any()


# bounds of the directional albedo for a white color, (params, θo) -> bound
EnergyBound = Callable[[Mapping[str, float], float], float]


def _half_vector_lobe_bound(params: Mapping[str, float], theta_o: float) -> float:
    """∫ D cos θi 4 (wo·h) dωh ≤ 4 ∫ D dωh: Nguyen's normalization omits the 1/(4 wo·h) that converts dωh to dωi."""
    return 4 * (params["exponent"] + 2) / (params["exponent"] + 1)


def _generalized_lobe_bound(params: Mapping[str, float], theta_o: float) -> float:
    """∫ (s + 2)/2π cos^s γ dω = (s + 2)/(s + 1), times |C ∘ wo| / max |C| ≤ 1."""
    return (params["exponent"] + 2) / (params["exponent"] + 1)


def _projected_area_bound(model: str, scale: float) -> EnergyBound:
    """scale · ∫ D max(wo·h, 0) dωh / cos θo: facets that nothing masks reflect all light on their projected area."""
    curve = TERMS[model].curve("theta_h")

    def bound(params: Mapping[str, float], theta_o: float) -> float:
        across = hemisphere_integral(curve, params, 0, lambda theta: np.sin(theta) / np.pi)
        return scale * (hemisphere_integral(curve, params, 1) + np.tan(theta_o) * across)

    return bound


def _smooth_fibers_bound(params: Mapping[str, float], theta_o: float) -> float:
    """The published fit of the masking of smooth fibers is too low at the horizon: their albedo reaches 2.8 there."""
    return 1.0 if params["roughness"] >= 0.25 else _projected_area_bound("sheen", 1.0)(params, theta_o)


ENERGY_BOUNDS: dict[str, EnergyBound] = {
    "blinn_phong": _half_vector_lobe_bound,
    "lafortune": _generalized_lobe_bound,
    "ward_duer": _projected_area_bound("ward_duer", 4.0),
    "schlick": _projected_area_bound("schlick", 1 / np.pi),
    "beard_maxwell": _projected_area_bound("beard_maxwell", 1.0),
    # the paper fits its functions to numerical integrals; at grazing angles the fit is a few percent too high
    "oren_nayar": lambda params, theta_o: 1.05,
    "sheen": _smooth_fibers_bound,
    # the tests' material is half diffuse, and has a highlight that reflects all light at grazing angles
    "measured_hf": lambda params, theta_o: 1.5,
}
"""Terms that may reflect more than the incident light; all others claim an albedo of at most one."""

_ALBEDO_TOLERANCE = 2e-3  # of the adaptive quadrature


def assert_conserves_energy(document: Mapping[str, Any], cos_theta_o: float, phi_o: float) -> None:
    """∫ f cos θi dωi ≤ 1, or the term's own bound, for a white color."""
    sin_theta_o = np.sqrt(1 - cos_theta_o**2)
    wo = np.array([sin_theta_o * np.cos(phi_o), sin_theta_o * np.sin(phi_o), cos_theta_o])
    albedo = directional_albedo(document, wo)
    bound = ENERGY_BOUNDS.get(document["model"], lambda params, theta_o: 1.0)
    allowed = bound(document.get("params", {}), float(np.arccos(cos_theta_o)))
    assert 0 <= albedo <= allowed * (1 + _ALBEDO_TOLERANCE)


def directional_albedo(document: Mapping[str, Any], wo: F64, tolerance: float = 2e-4) -> float:
    """∫ f cos θi dωi of the first channel, by adaptive cubature over θi and φi; f may be a very narrow lobe."""

    def integrand(theta: F64, phi: F64) -> F64:
        wi = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
        return np.asarray(eval_brdf(document, wi, wo)[..., 0] * np.cos(theta) * np.sin(theta))

    def integrals(cells: F64) -> F64:
        """Gauss–Legendre rule of 4 × 4 nodes in each cell θ0, φ0, Δθ, Δφ. (n, 4) -> (n,)"""
        x, w = np.polynomial.legendre.leggauss(4)
        x, w = (x + 1) / 2, w / 2
        theta = cells[:, 0, None, None] + cells[:, 2, None, None] * x[:, None]
        phi = cells[:, 1, None, None] + cells[:, 3, None, None] * x
        return (
            np.asarray(np.einsum("nij,i,j->n", integrand(*np.broadcast_arrays(theta, phi)), w, w))
            * cells[:, 2]
            * cells[:, 3]
        )

    peak = _find_peak(integrand)
    theta, phi = np.meshgrid(np.arange(8) * np.pi / 16, np.arange(16) * np.pi / 8, indexing="ij")
    size = np.full(128, np.pi / 16), np.full(128, np.pi / 8)
    cells = np.stack([theta.ravel(), phi.ravel(), *size], axis=-1)
    values, total = integrals(cells), 0.0
    for _ in range(24):
        half = cells[:, 2:] / 2
        corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
        children = np.concatenate([cells[:, None, :2] + corners * half[:, None], np.repeat(half[:, None], 4, 1)], 2)
        refined = integrals(children.reshape(-1, 4)).reshape(-1, 4)
        error = np.abs(refined.sum(axis=1) - values)
        has_peak = np.all((peak >= cells[:, :2]) & (peak < cells[:, :2] + cells[:, 2:]), axis=1) & (cells[:, 2] > 1e-3)
        is_coarse = (error > tolerance / 100) | has_peak
        total += refined[~is_coarse].sum()
        cells, values = children[is_coarse].reshape(-1, 4), refined[is_coarse].ravel()
        if not len(cells):
            break
    return float(total + values.sum())


def _find_peak(integrand: Callable[[F64, F64], F64]) -> F64:
    """θ, φ where the integrand is large: the best of random directions, then of others ever nearer to it."""
    rng = np.random.default_rng(1)
    theta, phi = np.arccos(rng.uniform(0, 1, 4000)), rng.uniform(0, 2 * np.pi, 4000)
    for spread in 0.3 * 0.6 ** np.arange(14):
        best = int(np.argmax(integrand(theta, phi)))
        theta = np.clip(theta[best] + spread * np.append(0, rng.normal(size=100)), 0, np.pi / 2)
        phi = (phi[best] + spread * np.append(0, rng.normal(size=100))) % (2 * np.pi)
    best = int(np.argmax(integrand(theta, phi)))
    return np.array([theta[best], phi[best]])


def hemisphere_integral(
    curve: Curve, params: Mapping[str, float], power: float, factor: Callable[[F64], F64] = np.ones_like
) -> float:
    """∫ f(θ) cos^power θ · factor(θ) dω with a fine quadrature."""
    edges = np.concatenate([[0], np.geomspace(1e-6, np.pi / 2, 400)])
    x, w = np.polynomial.legendre.leggauss(16)
    theta = edges[:-1, None] + 0.5 * np.diff(edges)[:, None] * (1 + x)
    weight = 0.5 * np.diff(edges)[:, None] * w
    values = curve.generator(theta, params) * np.cos(theta) ** power * np.sin(theta) * factor(theta)
    return 2 * np.pi * float(np.sum(values * weight))
