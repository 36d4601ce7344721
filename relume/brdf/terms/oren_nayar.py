"""oren_nayar: the full model of Oren & Nayar 1994, facets that shadow, mask and light each other; entirely a quotient.

σ, the deviation of the facets' slope angles, and the albedo of doubly reflected light are fixed. The paper has the
albedo squared in that part; one factor is the term's color. The curve over θi is one until it is drawn.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from relume.brdf.half_vector import HALF, MIN_COSINE, ONE, ZERO, quotient_ufunc_with
from relume.brdf.term import Angle, Curve, Parameter, Params, Term
from relume.brdf.terms.lambert import constant

_PER_PI, _PER_HALF_PI = 1.0 / math.pi, 2.0 / math.pi


@quotient_ufunc_with(2)
def quotient(sigma, albedo, wi_x, wi_y, wi_z, wo_x, wo_y, wo_z):  # type: ignore[no-untyped-def]
    """(L1 + L2)/(ρ E0 cos θi): radiance after one and two reflections, per albedo and irradiance.

    Args:
        sigma: the slope's standard deviation σ, radians. albedo: the albedo ρ of a facet.
        wi_x, wi_y, wi_z: light direction, local frame, unit. (...) each
        wo_x, wo_y, wo_z: view direction, likewise; they broadcast.
    """
    if wi_z <= ZERO or wo_z <= ZERO:
        return ZERO
    # tangents overflow within 2e-4 degrees of the horizon; α is the larger of the two angles, β the smaller
    cos_i, cos_o = min(max(wi_z, MIN_COSINE), ONE), min(max(wo_z, MIN_COSINE), ONE)
    cos_alpha, cos_beta = min(cos_i, cos_o), max(cos_i, cos_o)
    alpha, beta = math.acos(cos_alpha), math.acos(cos_beta)
    sin_alpha, sin_beta = math.sqrt(ONE - cos_alpha * cos_alpha), math.sqrt(ONE - cos_beta * cos_beta)
    sines = math.sqrt((wi_x * wi_x + wi_y * wi_y) * (wo_x * wo_x + wo_y * wo_y))
    # at normal incidence there is no azimuth, but tan β, its factor, is zero
    cos_phi = (wi_x * wo_x + wi_y * wo_y) / max(sines, 1e-12)
    cos_phi = min(max(cos_phi, -ONE), ONE)
    variance = sigma * sigma
    roughness_factor = variance / (variance + 0.09)
    low = beta * _PER_HALF_PI
    c1 = ONE - HALF * variance / (variance + 0.33)
    c2 = 0.45 * roughness_factor * (sin_alpha - (low * low * low if cos_phi < ZERO else ZERO))
    c3 = 0.125 * roughness_factor * (alpha * _PER_HALF_PI * low) ** 2
    tan_half_sum = (sin_alpha + sin_beta) / (cos_alpha + cos_beta)  # of α + β
    single_bounce = c1 + cos_phi * c2 * sin_beta / cos_beta + c3 * (ONE - abs(cos_phi)) * tan_half_sum
    double_bounce = albedo * 0.17 * variance / (variance + 0.13) * (ONE - cos_phi * low * low)
    # the published fit is negative for very rough facets viewed against grazing light
    return _PER_PI * max(single_bounce + double_bounce, ZERO)


def normalize(params: Params) -> dict[str, Any]:
    """Return the quotient with the parameters σ and ρ applied."""
    return {"quotient": partial(quotient, params["sigma"], params["albedo"])}


OREN_NAYAR = Term(
    model="oren_nayar",
    label="Oren–Nayar (rough diffuse)",
    parameters=(
        Parameter("sigma", "Roughness σ", 0.0, 1.0, 0.5, "rad", "linear", "Deviation of slopes; 0 is Lambert."),
        Parameter("albedo", "Albedo between facets", 0.0, 1.0, 0.5, "", "linear", "Of light reflected twice."),
    ),
    curves=(Curve("theta_i", "light angle θi", Angle.THETA_I, constant, (), 64),),
    quotient=partial(quotient, 0.5, 0.5),
    source="Oren & Nayar 1994, the full model with interreflections",
    texture="diffuse",
    help="Clay, plaster, the moon: flatter than Lambert, and bright when viewed from the light's direction.",
    fixed=("sigma", "albedo"),
    normalize=normalize,
)
