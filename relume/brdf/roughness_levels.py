"""Terms with a roughness map: the same document at several roughness levels.

    width(x) = width · ratio(x)^power,   ratio = roughness of the texel / roughness of the material

Normals that vary within a pixel widen the lobe by the variance σ² of their slopes. The facets of GGX are convolved with
a Gaussian (`relume.brdf.terms.ggx`); other lobes keep their shape, and α² becomes α² + 2 σ² (Olano and Baker 2010).

A curve generated from the width differs between levels; a drawn curve is the same at all levels.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.curves import SLOPE_VARIANCE, curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve

F64 = NDArray[np.float64]


class RoughnessLevels(NamedTuple):
    """Roughness levels of a material's samples from its roughness map.

    Attributes:
        pairs: of each level, roughness divided by the material's, and slope variance; empty without a map.
        level: roughness level of each sample, ascending.
    """

    pairs: tuple[tuple[float, float], ...]
    level: Shaped[NDArray[np.uint8], " n"]

    def documents(self, document: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Return a term document at each level; see `scaled_roughness`."""
        return [scaled_roughness(document, *pair) for pair in self.pairs]


NO_LEVELS = RoughnessLevels((), np.empty(0, np.uint8))


def uses_roughness_map(document: Mapping[str, Any]) -> bool:
    """True if a term's width is scaled by its material's roughness map."""
    return bool(document.get("roughness_map")) and TERMS[document["model"]].width is not None


def scaled_roughness(document: Mapping[str, Any], ratio: float, slope_variance: float = 0.0) -> dict[str, Any]:
    """Return a term document at a roughness level; an unchanged copy if the term uses no roughness map.

    Args:
        document: a term of a complete look. ratio: of the roughness, within the parameter's range.
        slope_variance: of normals within a pixel, along each axis.
    """
    term = TERMS[document["model"]]
    if term.width is None or not uses_roughness_map(document):
        return dict(document)
    name, power = term.width
    declared = term.parameter(name)
    params = document.get("params") or {}
    scaled = np.asarray(params.get(name, declared.default)) * ratio**power
    if slope_variance > 0 and not term.convolves_slopes:
        # exponents are 2 / α² (Walter 2007)
        alpha2 = np.maximum(scaled, 1e-9) ** (4 / power) * (2 if power < 0 else 1)
        scaled = scaled * (1 + 2 * slope_variance / alpha2) ** (power / 4)
    limited = np.clip(scaled, declared.minimum, declared.maximum).tolist()
    widened = {SLOPE_VARIANCE: slope_variance} if slope_variance > 0 and term.convolves_slopes else {}
    return {**document, "params": {**params, name: limited}, **widened}


def level_bands(document: Mapping[str, Any], curve: Curve, levels: RoughnessLevels) -> F64:
    """Bands of a curve at all roughness levels.

    Args:
        document: a term of a complete look. curve: one of its model's curves. levels: levels of the samples.
    Returns:
        (L, 3, J) if the curve depends on the width, else (3, J)
    """
    if not _depends_on_roughness(document, curve, levels):
        return curve_bands(document, curve)
    return np.stack([curve_bands(level, curve) for level in levels.documents(document)])


def level_values(
    document: Mapping[str, Any], curve: Curve, gamma: Shaped[F64, " n"], levels: RoughnessLevels
) -> Shaped[F64, "3 n"]:
    """Evaluate a curve at the angle and the roughness level of each sample; see `relume.brdf.curves.curve_values`.

    Args:
        document, curve, levels: as in `level_bands`. gamma: angle of each sample, radians.
    """
    if not _depends_on_roughness(document, curve, levels):
        return curve_values(document, curve, gamma)
    values = np.empty((3, len(gamma)))
    bounds = np.searchsorted(levels.level, np.arange(len(levels.pairs) + 1))
    for level, first, last in zip(levels.documents(document), bounds[:-1], bounds[1:], strict=True):
        if first < last:
            values[:, first:last] = curve_values(level, curve, gamma[first:last])
    return values


def _depends_on_roughness(document: Mapping[str, Any], curve: Curve, levels: RoughnessLevels) -> bool:
    width = TERMS[document["model"]].width
    return len(levels.pairs) > 0 and width is not None and uses_roughness_map(document) and width[0] in curve.parameters
