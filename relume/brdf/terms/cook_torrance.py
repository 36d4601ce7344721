"""cook_torrance: Beckmann facets, exact Fresnel, V-cavity masking; eq. 10, Ben-Artzi 2006 (which has 4π below)."""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.fresnel import fresnel
from relume.brdf.half_vector import MIN_COSINE, ONE, TWO, ZERO, half_vector_cosines, quotient_ufunc
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term

_SCALE = 1.0 / (4.0 * math.pi)


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """G/(4π (n·wi)(n·wo)), G = min(1, 2 (n·h)(n·wo)/(wo·h), 2 (n·h)(n·wi)/(wo·h)); zero at and below the horizon.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    cos_theta_h, cos_theta_d = half_vector_cosines(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z)
    masking = min(ONE, TWO * cos_theta_h * min(wi_z, wo_z) / cos_theta_d)
    # within 2e-4 degrees of the horizon the division would overflow; masking makes the value vanish there anyway
    return _SCALE * (masking / (max(wi_z, MIN_COSINE) * max(wo_z, MIN_COSINE)))


def ndf(theta_h: F64, params: Params) -> F64:
    """D = exp(-tan² θh / σ²) / (σ² cos⁴ θh)."""
    sigma2 = params["sigma"] ** 2
    cos2 = np.maximum(np.cos(theta_h) ** 2, 1e-30)  # at 90° the exponential dominates the vanishing cosine
    return np.asarray(np.exp(-(1.0 - cos2) / (cos2 * sigma2)) / (sigma2 * cos2 * cos2))


def reflectance(theta_d: F64, params: Params) -> F64:
    """Unpolarized Fresnel reflectance F(η, k) at a difference angle."""
    return fresnel(np.cos(theta_d), params["ior"], params["extinction"])


COOK_TORRANCE = Term(
    model="cook_torrance",
    label="Cook–Torrance",
    parameters=(
        Parameter("sigma", "Roughness σ", 0.005, 2.0, 0.2, "", "log", "Root-mean-square slope of the facets."),
        Parameter("ior", "Refraction η", 1.0, 10.0, 1.5, "", "log", "Index of refraction; glass and plastic 1.5."),
        Parameter("extinction", "Extinction k", 0.0, 10.0, 0.0, "", "linear", "Absorption; 0 for dielectrics."),
    ),
    curves=(
        Curve("theta_h", "half angle θh", Angle.THETA_H, ndf, ("sigma",), 256),
        Curve("theta_d", "difference angle θd", Angle.THETA_D, reflectance, ("ior", "extinction"), 64),
    ),
    quotient=quotient,
    source="Ben-Artzi 2006, eq. 10: f = D F G / (4π (n·wi)(n·wo))",
    texture="specular",
    help="Rough metal or plastic: a highlight of Beckmann-distributed facets with the Fresnel effect.",
    width=("sigma", 2),
)
