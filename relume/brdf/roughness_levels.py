"""Terms with a roughness map: the same document at several roughness levels.

    width(x) = width · ratio(x)^power,   ratio = roughness of the texel / roughness of the material

A curve generated from the width differs between levels; a drawn curve is the same at all levels.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve

F64 = NDArray[np.float64]


class RoughnessLevels(NamedTuple):
    """Roughness levels of a material's samples from its roughness map.

    Attributes:
        ratios: roughness of each level divided by the material's; empty without a map.
        level: roughness level of each sample, ascending.
    """

    ratios: tuple[float, ...]
    level: Shaped[NDArray[np.uint8], " n"]


NO_LEVELS = RoughnessLevels((), np.empty(0, np.uint8))


def uses_roughness_map(document: Mapping[str, Any]) -> bool:
    """True if a term's width is scaled by its material's roughness map."""
    return bool(document.get("roughness_map")) and TERMS[document["model"]].width is not None


def scaled_roughness(document: Mapping[str, Any], ratio: float) -> dict[str, Any]:
    """Scale the width of a term document by the roughness `ratio`, within the parameter's range.

    Returns an unchanged copy if the term uses no roughness map.
    """
    term = TERMS[document["model"]]
    if term.width is None or not uses_roughness_map(document):
        return dict(document)
    name, power = term.width
    declared = term.parameter(name)
    given = (document.get("params") or {}).get(name, declared.default)
    scaled = np.clip(np.asarray(given) * ratio**power, declared.minimum, declared.maximum).tolist()
    return {**document, "params": {**(document.get("params") or {}), name: scaled}}


def level_bands(document: Mapping[str, Any], curve: Curve, levels: RoughnessLevels) -> F64:
    """Bands of a curve at all roughness levels.

    Args:
        document: a term of a complete look. curve: one of its model's curves. levels: levels of the samples.
    Returns:
        (L, 3, J) if the curve depends on the width, else (3, J)
    """
    if not _depends_on_roughness(document, curve, levels):
        return curve_bands(document, curve)
    return np.stack([curve_bands(scaled_roughness(document, ratio), curve) for ratio in levels.ratios])


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
    bounds = np.searchsorted(levels.level, np.arange(len(levels.ratios) + 1))
    for ratio, first, last in zip(levels.ratios, bounds[:-1], bounds[1:], strict=True):
        if first < last:
            values[:, first:last] = curve_values(scaled_roughness(document, ratio), curve, gamma[first:last])
    return values


def _depends_on_roughness(document: Mapping[str, Any], curve: Curve, levels: RoughnessLevels) -> bool:
    width = TERMS[document["model"]].width
    return (
        len(levels.ratios) > 0 and width is not None and uses_roughness_map(document) and width[0] in curve.parameters
    )
