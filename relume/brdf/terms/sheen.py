"""sheen: fibers that scatter at grazing angles; KHR_materials_sheen, after Estevez and Kulla 2017.

    f = D(θh) / (4 (n·wi)(n·wo) (1 + Λ(θi) + Λ(θo))),   D = (2 + 1/α) sin^(1/α) θh / 2π

Λ, the masking of fibers by each other, is a fit of the paper whose coefficients depend on α. 1/(1 + Λ + Λ) is not a
product of functions of one angle each, so it is part of the quotient, fixed.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numba as nb
import numpy as np

from relume.brdf.half_vector import HALF, MIN_COSINE, ONE, TWO, ZERO, quotient_ufunc_with
from relume.brdf.term import F64, Angle, Curve, Parameter, Params, Term
from relume.core.numba_options import NO_REFCOUNT

MIN_ROUGHNESS = 0.07  # as in the specification's sample implementation; less is a spike at the horizon
_QUARTER = np.float32(0.25)
# a to e of the fit at α = 0 and at α = 1 (Estevez and Kulla 2017, table 1)
_FIT_SMOOTH = (25.3245, 3.32435, 0.16801, -1.27393, -4.85967)
_FIT_ROUGH = (21.5473, 3.82987, 0.19823, -1.97760, -4.32054)
_DEFAULT = 0.5


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _masking(a, b, c, d, e, cosine):  # type: ignore[no-untyped-def]
    """Masking Λ of fibers at a cosine, eq. 3: e^L(x), whose logarithm is odd about x = 1/2."""
    x = min(cosine, ONE - cosine)
    fit = a / (ONE + b * x**c) + d * x + e
    if cosine < HALF:
        return math.exp(fit)
    middle = a / (ONE + b * HALF**c) + d * HALF + e
    return math.exp(TWO * middle - fit)


@quotient_ufunc_with(5)
def quotient(a, b, c, d, e, wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """1/(4 (n·wi)(n·wo) (1 + Λ(θi) + Λ(θo))), zero at and below the horizon.

    Args:
        a, b, c, d, e: coefficients of the fit, see `fit_coefficients`.
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    cos_i, cos_o = min(max(wi_z, MIN_COSINE), ONE), min(max(wo_z, MIN_COSINE), ONE)
    masking = _masking(a, b, c, d, e, cos_i) + _masking(a, b, c, d, e, cos_o)
    return _QUARTER / (cos_i * cos_o * (ONE + masking))


def fit_coefficients(roughness: float) -> tuple[float, ...]:
    """Coefficients a to e of Λ for a roughness."""
    smooth_weight = (1 - roughness**2) ** 2
    return tuple(
        smooth_weight * smooth + (1 - smooth_weight) * rough
        for smooth, rough in zip(_FIT_SMOOTH, _FIT_ROUGH, strict=True)
    )


def sheen_distribution(theta_h: F64, params: Params) -> F64:
    """Fiber distribution D, in 1/sr, for the width α = roughness²."""
    exponent = 1 / params["roughness"] ** 2
    return np.asarray((2 + exponent) * np.sin(theta_h) ** exponent / (2 * np.pi))


def normalize(params: Params) -> dict[str, Any]:
    """Return the quotient for a roughness."""
    return {"quotient": partial(quotient, *fit_coefficients(params["roughness"]))}


SHEEN = Term(
    model="sheen",
    label="Sheen (velvet)",
    parameters=(
        Parameter("roughness", "Roughness", MIN_ROUGHNESS, 1.0, _DEFAULT, "", "linear", "Less is a narrower edge."),
    ),
    curves=(Curve("theta_h", "half angle θh", Angle.THETA_H, sheen_distribution, ("roughness",), 256),),
    quotient=partial(quotient, *fit_coefficients(_DEFAULT)),
    source="Estevez & Kulla 2017: f = D / (4 (n·wi)(n·wo) (1 + Λ(θi) + Λ(θo)))",
    texture="specular",
    help="The bright edge of velvet: fibers that scatter light at grazing angles. The sheen of glTF materials.",
    fixed=("roughness",),
    normalize=normalize,
    is_steep=True,
)
