"""ggx_multiple: multiple scattering between the facets of ggx; add it to a ggx of equal parameters.

    f = F_ms (1 − E(θi)) (1 − E(θo)) / (π (1 − Ē)),   F_ms = F̄² Ē / (1 − F̄ (1 − Ē))

with E the single-scattering albedo of white facets, Ē = 2 ∫ E cos θ sin θ dθ its mean, and F̄ the mean of Schlick's F
(Kulla and Conty 2017). White facets, F̄ = 1, then conserve energy.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator

from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term
from relume.brdf.terms.ggx import masking, roughness_to_alpha
from relume.brdf.terms.lambert import quotient

_NUM_RADII, _NUM_AROUND = 64, 24  # half vectors, on one side of the plane of wo
_NUM_COSINES = 64  # of the mean
_STEPS = 64  # of the roughness; E is interpolated linearly between them
_NUM_BANDS = 64
# nodes at band edges: within each band the curve is one polynomial, whose mean is exact
_NUM_NODES = _NUM_BANDS + 1
_MIN_MISSING_ENERGY = 1e-7  # of the mean: smoother surfaces have no multiple scattering
_MEAN_RISE = 1 / 21  # mean of (1 − cos θ)⁵, weighted by the cosine


def _single_scattering_albedo(theta_o: F64, roughness: float) -> F64:
    """E(θo) = ∫ D G1(θi) G1(θo) (wo·h) / cos θo dωh for white facets. (n,) -> (n,)"""
    alpha, params = roughness_to_alpha(roughness), {"roughness": roughness}
    # tan² θh = α² u / (1 − u) samples D cos θh uniformly; u = 1 − (1 − s)³ is dense in the long tail
    one_minus_s = 1 - (np.arange(_NUM_RADII) + 0.5) / _NUM_RADII
    theta_h, weight = (
        np.arctan(alpha * np.sqrt((1 - one_minus_s**3) / one_minus_s**3))[:, None],
        3 * one_minus_s[:, None] ** 2,
    )
    phi = np.pi * (np.arange(_NUM_AROUND) + 0.5) / _NUM_AROUND
    sine, cosine = np.sin(theta_o)[:, None, None], np.cos(theta_o)[:, None, None]
    facing = sine * np.sin(theta_h) * np.cos(phi) + cosine * np.cos(theta_h)
    cos_i = 2 * facing * np.cos(theta_h) - cosine
    is_above = (cos_i > 0) & (facing > 0)
    theta_i = np.arccos(np.clip(np.where(is_above, cos_i, 1), 0, 1))
    # G1(θo) / cos θo, which has a limit at the horizon
    towards = 2 / (cosine + np.sqrt(cosine**2 + (alpha * sine) ** 2))
    integrand = weight * np.where(is_above, masking(theta_i, params) * facing / np.cos(theta_h), 0) * towards
    return np.asarray(integrand.mean(axis=(1, 2)))


@lru_cache(maxsize=1)
def _tabulate_missing_energy() -> tuple[F64, F64]:
    """1 − E at `_NUM_NODES` angles over [0, π/2], for `_STEPS` + 1 roughness values over [0, 1], and its means."""
    theta = np.linspace(0, np.pi / 2, _NUM_NODES)
    nodes, weights = np.polynomial.legendre.leggauss(_NUM_COSINES)
    cosines = (nodes + 1) / 2
    roughness = np.linspace(0, 1, _STEPS + 1)[1:]
    rows = np.maximum(1 - np.stack([_single_scattering_albedo(theta, r) for r in roughness]), 0)
    rows = np.concatenate([np.zeros((1, _NUM_NODES)), rows])
    means = [weights @ (cosines * np.interp(np.arccos(cosines), theta, row)) for row in rows]
    return rows, np.array(means)


def _interpolate_missing_energy(roughness: float) -> tuple[F64, float]:
    """1 − E at `_NUM_NODES` angles, and its mean, at one roughness."""
    rows, means = _tabulate_missing_energy()
    position = float(np.clip(roughness, 0, 1)) * _STEPS
    below = min(int(position), _STEPS - 1)
    fraction = position - below
    row, mean = ((1 - fraction) * values[below] + fraction * values[below + 1] for values in (rows, means))
    return np.asarray(row), float(mean)


def retained_energy(theta: F64, params: Params) -> F64:
    """1 − E(θ): energy that facets do not reflect by single scattering."""
    row, _ = _interpolate_missing_energy(params["roughness"])
    return np.asarray(PchipInterpolator(np.linspace(0, np.pi / 2, _NUM_NODES), row)(theta))


def released_energy(theta_o: F64, params: Params) -> F64:
    """F_ms (1 − E(θo)) / (1 − Ē): energy that leaves after multiple scattering."""
    _, mean = _interpolate_missing_energy(params["roughness"])
    if mean < _MIN_MISSING_ENERGY:
        return np.zeros_like(theta_o)
    reflected = params["f0"] + (1 - params["f0"]) * _MEAN_RISE
    multiple_scattering = reflected**2 * (1 - mean) / (1 - reflected * mean)
    return np.asarray(multiple_scattering / mean * retained_energy(theta_o, params))


GGX_MULTIPLE = Term(
    model="ggx_multiple",
    label="GGX, between facets",
    parameters=(
        Parameter("roughness", "Roughness", 0.01, 1.0, 0.4, "", "linear", "The same as that of its GGX."),
        Parameter("f0", "Reflectance f0", 0.0, 1.0, 0.04, "", "linear", "The same as that of its GGX."),
    ),
    curves=(
        Curve("theta_i", "light angle θi", Angle.THETA_I, retained_energy, ("roughness",), _NUM_BANDS),
        Curve("theta_o", "view angle θo", Angle.THETA_O, released_energy, ("roughness", "f0"), _NUM_BANDS),
    ),
    quotient=quotient,
    source="Kulla and Conty 2017: f = F_ms (1 − E(θi)) (1 − E(θo)) / (π (1 − Ē))",
    texture="specular",
    is_lambertian=True,
    help="Light that the facets of rough metals reflect more than once; without it they lose energy. Add it to a GGX.",
    width=("roughness", 1),
)
