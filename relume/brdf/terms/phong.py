"""phong: a highlight around the mirror direction, cos^s θr; eq. 5, Mahajan 2008, with a lobe of volume one."""

from __future__ import annotations

import math

import numpy as np

from relume.brdf.half_vector import hemisphere_indicator
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term


def lobe(theta_r: F64, params: Params) -> F64:
    """Lobe (s + 1)/(2π) cos^s θr, with s = `params["exponent"]`."""
    s = params["exponent"]
    return (s + 1.0) / (2.0 * math.pi) * np.cos(theta_r) ** s


PHONG = Term(
    model="phong",
    label="Phong",
    parameters=(
        Parameter("exponent", "Exponent", 1.0, 1e5, 20.0, "", "log", "Higher is a smaller, brighter highlight."),
    ),
    curves=(Curve("theta_r", "mirror angle θr", Angle.THETA_R, lobe, ("exponent",), 256),),
    quotient=hemisphere_indicator,
    source="Phong 1975, as Mahajan 2008, eq. 5: f = (s+1)/(2π) cos^s θr",
    texture="specular",
    help="The oldest highlight: round at every angle, and never brighter than the incident light.",
    width=("exponent", -4),
)
