"""lafortune: one generalized cosine lobe (Lafortune 1997), normalized as in Nguyen 2010.

f = (s + 2)/(2π) cos^s γ, cos γ = (Cx ix ox + Cy iy oy + Cz iz oz) / max(|Cx|, |Cy|, |Cz|). The C are fixed because they
define the angle.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from relume.brdf.half_vector import hemisphere_indicator
from relume.brdf.term import Angle, Curve, Parameter, Params, Term
from relume.brdf.terms.blinn_phong import lobe

_LOBE = Curve("lobe", "lobe angle", Angle.LOBE, lobe, ("exponent",), 256, (-1.0, -1.0, 1.0))


def normalize(params: Params) -> dict[str, Any]:
    """Return the curve with the axes of C; if all are zero, every angle is π/2 and there is no lobe."""
    c = (params["c_x"], params["c_y"], params["c_z"])
    largest = max(map(abs, c)) or 1.0
    return {"curves": (replace(_LOBE, axes=(c[0] / largest, c[1] / largest, c[2] / largest)),)}


LAFORTUNE = Term(
    model="lafortune",
    label="Lafortune",
    parameters=(
        Parameter("exponent", "Exponent", 1.0, 1e5, 20.0, "", "log", "Higher is a smaller, brighter highlight."),
        Parameter("c_x", "Cx", -1.0, 1.0, -1.0, "", "linear", "Along the tangent: -1 mirrors, +1 sends light back."),
        Parameter("c_y", "Cy", -1.0, 1.0, -1.0, "", "linear", "Across the tangent: unlike Cx, it is anisotropic."),
        Parameter("c_z", "Cz", 0.0, 1.0, 1.0, "", "linear", "Below |Cx|, the lobe tilts away from the mirror angle."),
    ),
    curves=(_LOBE,),
    quotient=hemisphere_indicator,
    source="Lafortune 1997, eq. 4, normalized by Nguyen 2010: f = (s+2)/(2π) cos^s γ",
    texture="specular",
    help="A highlight that tilts away from the mirror direction, or back to the light.",
    fixed=("c_x", "c_y", "c_z"),
    normalize=normalize,
    width=("exponent", -4),
)
