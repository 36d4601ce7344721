"""NumPy reference for the BRDF of a term, in float64, with curves at exact angles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Shaped

from relume.brdf.curves import curve_values
from relume.brdf.registry import TERMS
from relume.brdf.term import F64, Angle


def _normalize(v: F64) -> F64:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    # opposite directions have no half vector; the value does not matter, because such pairs lie on the horizon
    return np.asarray(v / np.where(length > 0, length, 1.0))


def angles_numpy(
    angle: Angle,
    wi: Shaped[F64, "*#batch 3"],
    wo: Shaped[F64, "*#batch 3"],
    axes: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> F64:
    """Evaluate the angle γ(wi, wo) of a curve, in radians, clamped to [0, π/2].

    Definitions: `THETA_R` between wi and the reflection of wo about the normal; `ALPHA` and `BETA` by eqs. 15 and 16,
    Ben-Artzi 2006: cos γα = (cos θh)^(cos² φh), cos γβ = (cos θh)^(sin² φh), φh from the tangent x; `TILT_X` and
    `TILT_Y`: tan γ = tan θh |cos φh|, tan θh |sin φh|; `LOBE`: cos γ = Σ axes · wi · wo, axis by axis.

    Args:
        angle: kind of angle.
        wi, wo: local frame, unit, z = normal; they broadcast.
        axes: axes of the curve, see `Curve.axes`.
    """
    wi, wo = np.broadcast_arrays(np.asarray(wi, np.float64), np.asarray(wo, np.float64))
    half = _normalize(wi + wo)
    cos_theta_h = np.clip(half[..., 2], 0.0, 1.0)
    match angle:
        case Angle.THETA_I:
            cosine = wi[..., 2]
        case Angle.THETA_O:
            cosine = wo[..., 2]
        case Angle.THETA_H:
            cosine = cos_theta_h
        case Angle.THETA_D:
            cosine = np.sum(half * wi, axis=-1)
        case Angle.THETA_R:
            cosine = np.sum(wi * wo * [-1.0, -1.0, 1.0], axis=-1)
        case Angle.LOBE:
            cosine = np.sum(wi * wo * axes, axis=-1)
        case Angle.TILT_X | Angle.TILT_Y:
            along = half[..., 0 if angle is Angle.TILT_X else 1]
            return np.arctan2(np.abs(along), np.maximum(half[..., 2], 0.0))
        case Angle.ALPHA | Angle.BETA:
            phi_h = np.arctan2(half[..., 1], half[..., 0])
            cosine = cos_theta_h ** np.square(np.cos(phi_h) if angle is Angle.ALPHA else np.sin(phi_h))
    return np.arccos(np.clip(cosine, 0.0, 1.0))


def eval_brdf(
    term_document: Mapping[str, Any], wi: Shaped[F64, "*#batch 3"], wo: Shaped[F64, "*#batch 3"]
) -> Shaped[F64, "*batch 3"]:
    """Evaluate the BRDF of one term: color · quotient · Π curves, in 1/sr, without the cosine and without textures.

    Args:
        term_document: one term of a complete look: model, color, params, curves.
        wi, wo: directions to light and viewer, local frame, unit, z = normal, x = tangent; they broadcast.
    Returns:
        BRDF per channel; zero below the horizon
    """
    term = TERMS[term_document["model"]].normalized(term_document)
    wi, wo = np.broadcast_arrays(np.asarray(wi, np.float64), np.asarray(wo, np.float64))
    value = np.moveaxis(term.quotients(*np.moveaxis(wi, -1, 0), *np.moveaxis(wo, -1, 0)), 0, -1)
    value = value * np.asarray(term_document.get("color", (1.0, 1.0, 1.0)), np.float64)
    for curve in term.active_curves(term_document):
        gamma = angles_numpy(curve.angle, wi, wo, curve.axes)
        value = value * np.moveaxis(curve_values(term_document, curve, gamma), 0, -1)
    return np.asarray(value)
