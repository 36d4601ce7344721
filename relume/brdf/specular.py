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

from relume.brdf.curve_edits import drawn_curves
from relume.brdf.term import Angle
from relume.brdf.terms.ggx import GGX

F64 = NDArray[np.float64]

MODEL, TEXTURE = GGX.model, "specular"  # its facet distribution is normalized; terms of other models stay lobes
SHARP, SOFT = 0.04, 0.06  # roughness up to which a term is entirely a mirror, and from which it is none


def specular_threshold(model: str) -> float | None:
    """Roughness below which terms of a model are at least partly mirrors; None if they never are."""
    return SOFT if model == MODEL else None


def specular_albedo(document: Mapping[str, Any]) -> Shaped[F64, " 3"]:
    """Fraction of a term, complete or not, that is a mirror, per channel in [0, 1]; the rest is its lobe."""
    if document["model"] != MODEL or document.get("texture") not in (TEXTURE, None) or document.get("roughness_map"):
        return np.zeros(3)
    ndf_curve = next(curve for curve in GGX.curves if curve.angle is Angle.THETA_H)
    if drawn_curves(document, ndf_curve):
        return np.zeros(3)
    default = GGX.parameter("roughness").default
    roughness = (document.get("params") or {}).get("roughness", default)
    return np.asarray(np.clip((SOFT - np.broadcast_to(roughness, 3)) / (SOFT - SHARP), 0, 1), np.float64)


def is_mirror(documents: Sequence[Mapping[str, Any]]) -> bool:
    """True if any term of a material is at least partly a mirror."""
    return any(specular_albedo(document).any() for document in documents)


def split_specular(document: Mapping[str, Any]) -> dict[str, Any]:
    """Scale a term of a complete look to its mirror fraction; the rest is its lobe."""
    color = specular_albedo(document) * np.asarray(document["color"], np.float64)
    return {**document, "color": color.tolist()}
