"""beard_maxwell: the first-surface reflection of Maxwell 1973, a half-angle curve and a difference-angle curve.

f = F(θd) D(θh) SO / (4 (n·wi)(n·wo)), SO = (1 + θh/Ω · exp(-2 θd/τ)) / (1 + θh/Ω): shadowing and obscuration. Maxwell
measures a scan s(θh) of the surface at θd = 0 and scales it by the exact Fresnel curve, F(θd)/F(0): D is 4 s cos² θh /
F(0). The curve can be drawn from such a scan; the parameters generate Cauchy-like slopes with a long tail, like scans.
τ and Ω are fixed. Light from the body is a separate sum and so a separate term: use `lambert` for the diffuse part;
Maxwell's volumetric part, 2 ρv / (cos θi + cos θo), is not supported.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from relume.brdf.fresnel import fresnel
from relume.brdf.half_vector import MIN_COSINE, ONE, TWO, ZERO, half_vector_cosines, quotient_ufunc_with
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term

_QUARTER = np.float32(0.25)


@quotient_ufunc_with(2)
def quotient(tau, omega, wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """SO/(4 (n·wi)(n·wo)), zero at and below the horizon.

    Args:
        tau, omega: the shadowing parameters τ and Ω, radians.
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    cos_theta_h, cos_theta_d = half_vector_cosines(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z)
    tilt = math.acos(cos_theta_h) / omega
    theta_d = math.acos(min(cos_theta_d, ONE))  # rounding may exceed one
    obscuration = (ONE + tilt * math.exp(-TWO * theta_d / tau)) / (ONE + tilt)
    # within 2e-4 degrees of the horizon the division would overflow
    return _QUARTER * (obscuration / (max(wi_z, MIN_COSINE) * max(wo_z, MIN_COSINE)))


def ndf(theta_h: F64, params: Params) -> F64:
    """D = B / (cos θh (σ² + tan² θh)), with B such that ∫ D cos θh dωh is one."""
    sigma2 = params["sigma"] ** 2
    a2 = 1.0 - sigma2
    # 1/(2πB) = ∫ t²/(1 - a² t²) dt over [0, 1]; near a = 0 the closed form loses precision
    a = math.sqrt(a2)
    integral = (math.atanh(a) / a - 1.0) / a2 if a2 > 1e-3 else 1.0 / 3.0 + a2 / 5.0 + a2 * a2 / 7.0
    cos = np.cos(theta_h)
    return np.asarray(cos / (2.0 * math.pi * integral * (sigma2 * cos * cos + np.sin(theta_h) ** 2)))


def reflectance(theta_d: F64, params: Params) -> F64:
    """Unpolarized Fresnel reflectance F(η, k) at a difference angle."""
    return fresnel(np.cos(theta_d), params["ior"], params["extinction"])


def normalize(params: Params) -> dict[str, Any]:
    """Return the quotient with the parameters τ and Ω applied."""
    return {"quotient": partial(quotient, math.radians(params["tau"]), math.radians(params["omega"]))}


BEARD_MAXWELL = Term(
    model="beard_maxwell",
    label="Beard–Maxwell",
    parameters=(
        Parameter("sigma", "Roughness σ", 0.01, 1.0, 0.15, "", "log", "Width of the slopes; their tail is long."),
        Parameter("ior", "Refraction η", 1.0, 10.0, 1.5, "", "log", "Index of refraction; glass and plastic 1.5."),
        Parameter("extinction", "Extinction k", 0.0, 10.0, 0.0, "", "linear", "Absorption; 0 for dielectrics."),
        Parameter("tau", "Shadowing τ", 1.0, 180.0, 15.0, "°", "log", "How soon tilted facets fall into shadow."),
        Parameter("omega", "Shadowing Ω", 1.0, 180.0, 40.0, "°", "log", "From which tilt on facets are hidden."),
    ),
    curves=(
        Curve("theta_h", "half angle θh", Angle.THETA_H, ndf, ("sigma",), 256),
        Curve("theta_d", "difference angle θd", Angle.THETA_D, reflectance, ("ior", "extinction"), 64),
    ),
    quotient=partial(quotient, math.radians(15.0), math.radians(40.0)),
    source="Maxwell 1973, first surface: f = F D SO / (4 (n·wi)(n·wo))",
    texture="specular",
    help="Painted surfaces as remote sensing knows them: tilted facets hide and shade each other.",
    fixed=("tau", "omega"),
    normalize=normalize,
    width=("sigma", 2),
)
