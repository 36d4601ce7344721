"""ashikhmin_shirley: anisotropic highlight as two curves, after the change of variables of Ben-Artzi 2006 (eqs. 11-16).

cos^(nu cos²φh + nv sin²φh) θh = cos^nu γα · cos^nv γβ with cos γα = (cos θh)^(cos² φh), cos γβ = (cos θh)^(sin² φh).
"""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.fresnel import schlick
from relume.brdf.half_vector import MIN_COSINE, ONE, ZERO, half_vector_cosines, quotient_ufunc
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term

_SCALE = 1.0 / (8.0 * math.pi)


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """1/(8π (wo·h) max(n·wi, n·wo)), zero at and below the horizon.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    _, cos_theta_d = half_vector_cosines(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z)
    # both directions within 2e-4 degrees of the horizon: the division would overflow
    return _SCALE * (ONE / (cos_theta_d * max(wi_z, wo_z, MIN_COSINE)))


def lobe_u(alpha: F64, params: Params) -> F64:
    """Lobe sqrt(nu + 1) cos^nu γα along the tangent."""
    return math.sqrt(params["nu"] + 1.0) * np.cos(alpha) ** params["nu"]


def lobe_v(beta: F64, params: Params) -> F64:
    """Lobe sqrt(nv + 1) cos^nv γβ across the tangent."""
    return math.sqrt(params["nv"] + 1.0) * np.cos(beta) ** params["nv"]


def reflectance(theta_d: F64, params: Params) -> F64:
    """Schlick's reflectance for f0, the choice of Ashikhmin and Shirley."""
    return schlick(np.cos(theta_d), params["f0"])


ASHIKHMIN_SHIRLEY = Term(
    model="ashikhmin_shirley",
    label="Ashikhmin–Shirley",
    parameters=(
        Parameter("nu", "Exponent along", 0.5, 1e5, 100.0, "", "log", "Sharpness along the tangent."),
        Parameter("nv", "Exponent across", 0.5, 1e5, 100.0, "", "log", "Sharpness across the tangent."),
        Parameter("f0", "Reflectance f0", 0.0, 1.0, 0.04, "", "linear", "Seen head-on; 0.04 for plastic and glass."),
    ),
    curves=(
        Curve("alpha", "along the tangent γα", Angle.ALPHA, lobe_u, ("nu",), 256),
        Curve("beta", "across the tangent γβ", Angle.BETA, lobe_v, ("nv",), 256),
        Curve("theta_d", "difference angle θd", Angle.THETA_D, reflectance, ("f0",), 64),
    ),
    quotient=quotient,
    source="Ashikhmin & Shirley 2000, as two curves by Ben-Artzi 2006, eqs. 11-16",
    texture="specular",
    help="Brushed metal: the highlight is stretched across the brushing.",
)
