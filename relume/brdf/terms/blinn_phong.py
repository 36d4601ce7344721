"""blinn_phong: a highlight around the half vector, cos^s θh, with the normalization of Nguyen 2010 (tables 3 and 4)."""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.half_vector import hemisphere_indicator
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term


def lobe(theta_h: F64, params: Params) -> F64:
    """Lobe (s + 2)/(2π) cos^s θh, with s = `params["exponent"]`."""
    s = params["exponent"]
    return (s + 2.0) / (2.0 * math.pi) * np.cos(theta_h) ** s


BLINN_PHONG = Term(
    model="blinn_phong",
    label="Blinn–Phong",
    parameters=(
        Parameter("exponent", "Exponent", 1.0, 2e5, 50.0, "", "log", "Higher is a smaller, brighter highlight."),
    ),
    curves=(Curve("theta_h", "half angle θh", Angle.THETA_H, lobe, ("exponent",), 256),),
    quotient=hemisphere_indicator,
    source="Nguyen 2010, tables 3 and 4: f = (s+2)/(2π) cos^s θh",
    texture="specular",
    help="A simple round highlight without Fresnel effect; reflects up to four times its color at high exponents.",
    width=("exponent", -4),
)
