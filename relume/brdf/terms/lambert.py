"""lambert: the ideal diffuse term. Quotient 1/π; one curve over θi, which is one until it is drawn.

Drawn over θi and θo it is LV, the analytic light–view model of Ben-Artzi 2006, table 1.
"""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.half_vector import ZERO, quotient_ufunc
from relume.brdf.term import F64, Angle, Curve, Params, Term


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """BRDF 1/π above the horizon, in 1/sr.

    Args:
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    return 1.0 / math.pi


def constant(theta_i: F64, params: Params) -> F64:
    """Return one at every angle: the unedited curve."""
    return np.ones_like(theta_i)


LAMBERT = Term(
    model="lambert",
    label="Lambert (diffuse)",
    parameters=(),
    curves=(Curve("theta_i", "light angle θi", Angle.THETA_I, constant, (), 64),),
    quotient=quotient,
    source="Lambert 1760: f = 1/π",
    texture="diffuse",
    is_lambertian=True,
    help="Light scattered uniformly in all directions; the color is the albedo. Drawn over θi and θo: LV.",
)
