"""Highlights that are sharp enough to be a mirror's: what is seen in them is a picture, not a patch of light.

Of a lobe that is narrower than what it reflects all light comes from where the eye is mirrored to, r:

    ∫ f(wi, wo) L(wi) cos θi dwi  →  L(r) Π_c f_c(θ),   θ = θi = θd = θo,

without the curve of θh, which integrates to one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.curves import curve_values, drawn_curves
from relume.brdf.registry import TERMS
from relume.brdf.roughness_levels import uses_roughness_map
from relume.brdf.term import Angle

F64 = NDArray[np.float64]

MODEL, TEXTURE = "ggx", "specular"  # its facets are normalised; terms of other models stay lobes
SHARP, SOFT = 0.04, 0.06  # roughness up to which all is mirrored, and from which nothing is


def specular_threshold(model: str) -> float | None:
    """The roughness below which terms of a model are mirrors, in part at least; None where none is."""
    return SOFT if model == MODEL else None


def specular_albedo(document: Mapping[str, Any]) -> F64:
    """How much of a term is a mirror: the rest is its lobe. (3,) within [0, 1]

    Args:
        document: a term, complete or not.
    """
    if document["model"] != MODEL or document.get("texture") not in (TEXTURE, None) or uses_roughness_map(document):
        return np.zeros(3)
    ndf_curve = next(curve for curve in TERMS[MODEL].curves if curve.angle is Angle.THETA_H)
    if drawn_curves(document, ndf_curve):
        return np.zeros(3)
    default = TERMS[MODEL].parameter("roughness").default
    roughness = (document.get("params") or {}).get("roughness", default)
    return np.asarray(np.clip((SOFT - np.broadcast_to(roughness, 3)) / (SOFT - SHARP), 0, 1), np.float64)


def is_mirror(documents: Sequence[Mapping[str, Any]]) -> bool:
    """Whether any term of a material is a mirror."""
    return any(specular_albedo(document).any() for document in documents)


def specular_terms(
    documents: Sequence[Mapping[str, Any]], cos_theta_i: NDArray[np.floating], tint: NDArray[Any]
) -> F64:
    """What a material's mirrors send on of what comes from where the eye is mirrored to.

    Args:
        documents: terms of a complete look. cos_theta_i: at which rays meet it. (n,)
        tint: its texture of highlights there. (n, 3)
    Returns:
        (n, 3)
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
    """A term as far as it is a mirror: what is left of it is its lobe. document: a term of a complete look"""
    color = specular_albedo(document) * np.asarray(document["color"], np.float64)
    return {**document, "color": color.tolist()}
