"""blinn_phong: a highlight around the half vector, cos^s θh, with the normalisation of Nguyen 2010 (tables 3 and 4)."""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.local import ONE, ZERO, quotient_ufunc
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term


@quotient_ufunc
def quotient(wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """One above the horizon."""
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    return ONE


def lobe(theta_h: F64, params: Params) -> F64:
    """(s + 2)/(2π) cos^s θh."""
    s = params["exponent"]
    return (s + 2.0) / (2.0 * math.pi) * np.cos(theta_h) ** s


BLINN_PHONG = Term(
    model="blinn_phong",
    label="Blinn–Phong",
    parameters=(
        Parameter("exponent", "Exponent", 1.0, 2000.0, 50.0, "", "log", "Higher is a smaller, brighter highlight."),
    ),
    curves=(Curve("theta_h", "half angle θh", Angle.THETA_H, lobe, ("exponent",), 256),),
    quotient=quotient,
    source="Nguyen 2010, tables 3 and 4: f = (s+2)/(2π) cos^s θh",
    texture="specular",
    help="A simple round highlight without Fresnel effect; reflects up to four times its colour at high exponents.",
)
