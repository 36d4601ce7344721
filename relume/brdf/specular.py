"""Highlights that are sharp enough to be treated as mirrors: they reflect an image instead of a blurred highlight.

A lobe much narrower than the detail of its surroundings reflects only the radiance from the mirror direction r:

    ∫ f(wi, wo) L(wi) cos θi dwi  →  L(r) Π_c f_c(θ),   θ = θi = θd = θo,

without the curve of θh, which integrates to one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.curves import curve_values, drawn_curves
from relume.brdf.registry import TERMS
from relume.brdf.roughness_levels import uses_roughness_map
from relume.brdf.term import Angle

F64 = NDArray[np.float64]

MODEL, TEXTURE = "ggx", "specular"  # its facet distribution is normalized; terms of other models stay lobes
SHARP, SOFT = 0.04, 0.06  # roughness up to which a term is entirely a mirror, and from which it is none


def specular_threshold(model: str) -> float | None:
    """Roughness below which terms of a model are at least partly mirrors; None if they never are."""
    return SOFT if model == MODEL else None


def specular_albedo(document: Mapping[str, Any]) -> Shaped[F64, " 3"]:
    """Fraction of a term, complete or not, that is a mirror, per channel in [0, 1]; the rest is its lobe."""
    if document["model"] != MODEL or document.get("texture") not in (TEXTURE, None) or uses_roughness_map(document):
        return np.zeros(3)
    ndf_curve = next(curve for curve in TERMS[MODEL].curves if curve.angle is Angle.THETA_H)
    if drawn_curves(document, ndf_curve):
        return np.zeros(3)
    default = TERMS[MODEL].parameter("roughness").default
    roughness = (document.get("params") or {}).get("roughness", default)
    return np.asarray(np.clip((SOFT - np.broadcast_to(roughness, 3)) / (SOFT - SHARP), 0, 1), np.float64)


def is_mirror(documents: Sequence[Mapping[str, Any]]) -> bool:
    """True if any term of a material is at least partly a mirror."""
    return any(specular_albedo(document).any() for document in documents)


def specular_terms(
    documents: Sequence[Mapping[str, Any]],
    cos_theta_i: Shaped[NDArray[np.floating], " n"],
    tint: Shaped[NDArray[Any], "n 3"],
) -> Shaped[F64, "n 3"]:
    """Specular reflectance of a material's mirror terms: reflected radiance per radiance from the mirror direction.

    Args:
        documents: terms of a complete look. cos_theta_i: cos θi at the hit points.
        tint: specular texture at the hit points.
    """
    theta, total = np.arccos(np.clip(cos_theta_i, 0, 1).astype(np.float64)), np.zeros((len(cos_theta_i), 3))
    for document in documents:
        fraction = specular_albedo(document)
        if fraction.any():
            curves = [curve for curve in TERMS[document["model"]].curves if curve.angle is not Angle.THETA_H]
            values = np.prod([curve_values(document, curve, theta) for curve in curves], axis=0).T
            total += (
                fraction * np.asarray(document["color"]) * values * (1 if document.get("texture") is None else tint)
            )
    return total


def split_specular(document: Mapping[str, Any]) -> dict[str, Any]:
    """Scale a term of a complete look to its mirror fraction; the rest is its lobe."""
    color = specular_albedo(document) * np.asarray(document["color"], np.float64)
    return {**document, "color": color.tolist()}
