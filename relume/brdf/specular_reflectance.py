"""Reflectance of the mirrors among a material's terms, see `relume.brdf.specular`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.curves import curve_values
from relume.brdf.specular import specular_albedo
from relume.brdf.term import Angle
from relume.brdf.terms.ggx import GGX

F64 = NDArray[np.float64]


def specular_terms(
    documents: Sequence[Mapping[str, Any]],
    cos_theta_i: Shaped[NDArray[np.floating], " n"],
    tint: Shaped[NDArray[Any], "n 3"],
) -> Shaped[F64, "n 3"]:
    """Specular reflectance of a material's mirror terms: reflected radiance per radiance from the mirror direction.

    Args:
        documents: terms of a complete look. cos_theta_i: at the hit points.
        tint: specular texture at the hit points.
    """
    theta, total = np.arccos(np.clip(cos_theta_i, 0, 1).astype(np.float64)), np.zeros((len(cos_theta_i), 3))
    for document in documents:
        fraction = specular_albedo(document)
        if fraction.any():
            curves = [curve for curve in GGX.curves if curve.angle is not Angle.THETA_H]
            values = np.prod([curve_values(document, curve, theta) for curve in curves], axis=0).T
            total += (
                fraction * np.asarray(document["color"]) * values * (1 if document.get("texture") is None else tint)
            )
    return total
