"""ward_duer: Ward's Gaussian of slopes with the normalization of Dür 2006, which does not darken at grazing angles."""

from __future__ import annotations

from relume.brdf.half_vector import MIN_COSINE, ONE, ZERO, quotient_ufunc
from relume.brdf.term import Angle, Curve, Parameter, Term
from relume.brdf.terms.ward import ndf


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """1/((n·wi)(n·wo)), zero at and below the horizon.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    # within 2e-4 degrees of the horizon the division would overflow
    return ONE / (max(wi_z, MIN_COSINE) * max(wo_z, MIN_COSINE))


WARD_DUER = Term(
    model="ward_duer",
    label="Ward–Dür",
    parameters=(Parameter("alpha", "Width α", 0.005, 2.0, 0.15, "", "log", "Root-mean-square slope of the surface."),),
    curves=(Curve("theta_h", "half angle θh", Angle.THETA_H, ndf, ("alpha",), 256),),
    quotient=quotient,
    source="Dür 2006: f = exp(-tan² θh / α²) / (4π α² (n·wi)(n·wo))",
    texture="specular",
    help="Ward's highlight, as bright at grazing angles as head-on; it gains energy very close to the horizon.",
    width=("alpha", 2),
)
