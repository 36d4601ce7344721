"""ward: a Gaussian of slopes around the half vector, isotropic (Ward 1992), as in Nguyen 2010."""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.half_vector import MIN_COSINE, ONE, ZERO, quotient_ufunc
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """1/sqrt((n·wi)(n·wo)), zero at and below the horizon.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    # within 2e-4 degrees of the horizon the division would overflow
    return ONE / math.sqrt(max(wi_z, MIN_COSINE) * max(wo_z, MIN_COSINE))


def slope_distribution(angle: F64, alpha: float) -> F64:
    """Slope distribution exp(-tan² γ / α²), zero at π/2."""
    cos2 = np.maximum(np.cos(angle) ** 2, 1e-30)  # at π/2 the exponential dominates the vanishing cosine
    return np.asarray(np.exp(-(1.0 - cos2) / (cos2 * alpha * alpha)))


def ndf(theta_h: F64, params: Params) -> F64:
    """Normalized slope distribution exp(-tan² θh / α²) / (4π α²)."""
    alpha = params["alpha"]
    return slope_distribution(theta_h, alpha) / (4.0 * math.pi * alpha * alpha)


WARD = Term(
    model="ward",
    label="Ward",
    parameters=(Parameter("alpha", "Width α", 0.005, 2.0, 0.15, "", "log", "Root-mean-square slope of the surface."),),
    curves=(Curve("theta_h", "half angle θh", Angle.THETA_H, ndf, ("alpha",), 256),),
    quotient=quotient,
    source="Ward 1992, eq. 4: f = exp(-tan² θh / α²) / (4π α² √((n·wi)(n·wo)))",
    texture="specular",
    help="A highlight fitted to measurements of paints, plastics and metals; darkens toward grazing angles.",
    width=("alpha", 2),
)
