"""ggx: Walter 2007 with separable Smith masking; the metallic-roughness model of glTF (its metals: f0 per channel)."""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.fresnel import schlick
from relume.brdf.half_vector import MIN_COSINE, ZERO, quotient_ufunc
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term

_QUARTER = np.float32(0.25)
_LOG_E, _NUM_NODES = (-18.0, 3.6), 37
_MIN_COS2 = 1e-12  # grazing facets have no slope


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """1/(4 (n·wi)(n·wo)), zero at and below the horizon.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    # within 2e-4 degrees of the horizon the division would overflow; the masking curves vanish there
    return _QUARTER / (max(wi_z, MIN_COSINE) * max(wo_z, MIN_COSINE))


def roughness_to_alpha(roughness: float) -> float:
    """Width α of the facet distribution: the square of the slider's roughness (Burley 2012, and glTF)."""
    return roughness * roughness


def ndf(theta_h: F64, params: Params) -> F64:
    """D = α² / (π cos⁴ θh (α² + tan² θh)²), eq. 33, Walter 2007; written without the tangent, which has a pole.

    With the "slope_variance" σ² of normals within a pixel, their distribution is convolved with it.
    """
    alpha2 = roughness_to_alpha(params["roughness"]) ** 2
    cos2 = np.cos(theta_h) ** 2
    sin2 = np.sin(theta_h) ** 2
    variance = params.get("slope_variance", 0.0)
    if variance > 0:
        return _convolved(alpha2, 2 * variance, sin2, np.maximum(cos2, _MIN_COS2))
    return np.asarray(alpha2 / (math.pi * np.square(alpha2 * cos2 + sin2)))


def _convolved(alpha2: float, added: float, sin2: F64, cos2: F64) -> F64:
    """GGX convolved with a Gaussian of slopes of the variance `added` / 2 along each axis.

    Slopes of GGX are a mixture of Gaussians: with E distributed as e^−E,

        P(t) = α² / (π (α² + t²)²) = ⟨ e^(−t²/v) / (π v) ⟩,   v = α² / E,

    so that v + `added` replaces v. The mean is by the trapezoidal rule in ln E.
    """
    log_e = np.linspace(_LOG_E[0], _LOG_E[1], _NUM_NODES)
    weights = np.exp(log_e - np.exp(log_e)) * (log_e[1] - log_e[0])
    total, slope2 = np.zeros_like(sin2), sin2 / cos2
    for width, weight in zip(alpha2 * np.exp(-log_e) + added, weights, strict=True):
        total += weight / (math.pi * width) * np.exp(-slope2 / width)
    return np.asarray(total / np.square(cos2))


def masking(theta: F64, params: Params, power: float = 0.0) -> F64:
    """G1 cos^p θ, G1 = 2 / (1 + sqrt(1 + α² tan² θ)), eq. 34, Walter 2007; without the tangent, which has a pole.

    Args:
        theta: angle θ, radians. params: of the term. power: p.
    """
    alpha2 = roughness_to_alpha(params["roughness"]) ** 2
    cos = np.cos(theta)
    return np.asarray(2.0 * cos ** (1 + power) / (cos + np.sqrt(cos * cos + alpha2 * np.sin(theta) ** 2)))


def light_masking(theta_i: F64, params: Params) -> F64:
    """G1(wi) / cos^(w/2) θi, see `_share_of_normals`."""
    return masking(theta_i, params, -_share_of_normals(params) / 2)


def view_masking(theta_o: F64, params: Params) -> F64:
    """G1(wo) cos^(w/2) θo, see `_share_of_normals`."""
    return masking(theta_o, params, _share_of_normals(params) / 2)


def _share_of_normals(params: Params) -> float:
    """Share w = 2 σ² / (α² + 2 σ²) of the normals within a pixel in the slope of a half vector.

    These normals n are on a surface that stays flat: all are seen alike, and none hides another. The mean over them has
    1/(4 n·wo) where facets of that slope would have 1/(4 cos θo). If normals alone vary they are the half vectors, and
    n·wo = cos θd; in general n·wo ≈ cos^(1−w) θo cos^w θd, with cos² θd ≈ cos θi cos θo beside the mirror direction.
    """
    variance = 2 * params.get("slope_variance", 0.0)
    return float(variance / (roughness_to_alpha(params["roughness"]) ** 2 + variance))


def reflectance(theta_d: F64, params: Params) -> F64:
    """Schlick's reflectance at a difference angle, for the reflectance f0 at normal incidence."""
    return schlick(np.cos(theta_d), params["f0"])


GGX = Term(
    model="ggx",
    label="GGX",
    parameters=(
        Parameter("roughness", "Roughness", 0.01, 1.0, 0.4, "", "linear", "As artists know it; α is its square."),
        Parameter("f0", "Reflectance f0", 0.0, 1.0, 0.04, "", "linear", "Seen head-on; 0.04 for plastic and glass."),
    ),
    curves=(
        Curve("theta_h", "half angle θh", Angle.THETA_H, ndf, ("roughness",), 256),
        Curve("theta_d", "difference angle θd", Angle.THETA_D, reflectance, ("f0",), 64),
        Curve("theta_i", "light masking θi", Angle.THETA_I, light_masking, ("roughness",), 64),
        Curve("theta_o", "view masking θo", Angle.THETA_O, view_masking, ("roughness",), 64),
    ),
    quotient=quotient,
    source="Walter 2007, eqs. 20, 33, 34: f = D F G1(wi) G1(wo) / (4 (n·wi)(n·wo))",
    texture="specular",
    help="The highlight of glTF materials, with a long soft tail.",
    width=("roughness", 1),
    convolves_slopes=True,
)
