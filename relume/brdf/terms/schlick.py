"""schlick: Schlick 1994 with his roughness function, isotropic (azimuth factor A = 1) and without masking."""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.fresnel import schlick
from relume.brdf.half_vector import MIN_COSINE, ONE, ZERO, quotient_ufunc
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term

_SCALE = 1.0 / (4.0 * math.pi)


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """1/(4π (n·wi)(n·wo)), zero at and below the horizon.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    # within 2e-4 degrees of the horizon the division would overflow
    return _SCALE * (ONE / (max(wi_z, MIN_COSINE) * max(wo_z, MIN_COSINE)))


def ndf(theta_h: F64, params: Params) -> F64:
    """Z = r / (1 + r t² - t²)², t = cos θh; uses the sine, because 1 - t² loses precision at the peak."""
    r = params["roughness"]
    return np.asarray(r / np.square(r * np.cos(theta_h) ** 2 + np.sin(theta_h) ** 2))


def reflectance(theta_d: F64, params: Params) -> F64:
    """Schlick's reflectance at a difference angle, for the reflectance f0 at normal incidence."""
    return schlick(np.cos(theta_d), params["f0"])


SCHLICK = Term(
    model="schlick",
    label="Schlick",
    parameters=(
        Parameter("roughness", "Roughness r", 0.0001, 1.0, 0.05, "", "log", "0 is a mirror, 1 is uniform."),
        Parameter("f0", "Reflectance f0", 0.0, 1.0, 0.04, "", "linear", "Seen head-on; 0.04 for plastic and glass."),
    ),
    curves=(
        Curve("theta_h", "half angle θh", Angle.THETA_H, ndf, ("roughness",), 256),
        Curve("theta_d", "difference angle θd", Angle.THETA_D, reflectance, ("f0",), 64),
    ),
    quotient=quotient,
    source="Schlick 1994, without masking: f = Z(θh) F(θd) / (4π (n·wi)(n·wo))",
    texture="specular",
    help="A cheap variant of Cook–Torrance with a long tail; it gains energy very close to the horizon.",
    width=("roughness", 4),
)
