"""ward_anisotropic: Ward 1992 as two curves, derived as Ben-Artzi 2006 does for Ashikhmin-Shirley (section 4.3).

exp(-tan² θh (cos² φh / αx² + sin² φh / αy²)) = exp(-tan² γx / αx²) · exp(-tan² γy / αy²), where tan γx =
tan θh |cos φh| = |hx| / hz is the half vector's tilt along the tangent, and tan γy = tan θh |sin φh| that across.
"""

from __future__ import annotations

import math

from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term
from relume.brdf.terms.ward import quotient, slope_distribution

_SCALE = 1.0 / math.sqrt(4.0 * math.pi)


def lobe_x(tilt_x: F64, params: Params) -> F64:
    """Lobe exp(-tan² γx / αx²) / (√(4π) αx) along the tangent."""
    return slope_distribution(tilt_x, params["alpha_x"]) * (_SCALE / params["alpha_x"])


def lobe_y(tilt_y: F64, params: Params) -> F64:
    """Lobe exp(-tan² γy / αy²) / (√(4π) αy) across the tangent."""
    return slope_distribution(tilt_y, params["alpha_y"]) * (_SCALE / params["alpha_y"])


WARD_ANISOTROPIC = Term(
    model="ward_anisotropic",
    label="Ward, anisotropic",
    parameters=(
        Parameter("alpha_x", "Width αx", 0.005, 2.0, 0.1, "", "log", "Slopes along the tangent."),
        Parameter("alpha_y", "Width αy", 0.005, 2.0, 0.3, "", "log", "Slopes across the tangent."),
    ),
    curves=(
        Curve("tilt_x", "tilt along the tangent γx", Angle.TILT_X, lobe_x, ("alpha_x",), 256),
        Curve("tilt_y", "tilt across the tangent γy", Angle.TILT_Y, lobe_y, ("alpha_y",), 256),
    ),
    quotient=quotient,
    source="Ward 1992, eq. 5a, as two curves by the method of Ben-Artzi 2006, section 4.3",
    texture="specular",
    help="Ward's highlight on brushed metal, hair or varnished wood: wider in one direction than in the other.",
)
