"""Terms whose width a map scales: the same document at several levels of roughness.

    width(x) = width · ratio(x)^power,   ratio = roughness of the texel over the material's

A curve that the width generates differs from level to level; a drawn one stands at all levels alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve

F64 = NDArray[np.float64]


class RoughnessLevels(NamedTuple):
    """How rough a material's samples are, as its map says.

    Attributes:
        ratios: roughness of each level over the material's; none where it has no map. (L,)
        level: of each sample, rising. (n,) uint8
    """

    ratios: tuple[float, ...]
    level: NDArray[np.uint8]


NO_LEVELS = RoughnessLevels((), np.empty(0, np.uint8))


def uses_roughness_map(document: Mapping[str, Any]) -> bool:
    """Whether a term's width is scaled where its material has a map of roughness."""
    return bool(document.get("roughness_map")) and TERMS[document["model"]].width is not None


def scaled_roughness(document: Mapping[str, Any], ratio: float) -> dict[str, Any]:
    """The document of a term where its material is `ratio` times as rough, within the range of its parameter; the same
    where it follows no map."""
    term = TERMS[document["model"]]
    if term.width is None or not uses_roughness_map(document):
        return dict(document)
    name, power = term.width
    declared = term.parameter(name)
    given = (document.get("params") or {}).get(name, declared.default)
    scaled = np.clip(np.asarray(given) * ratio**power, declared.minimum, declared.maximum).tolist()
    return {**document, "params": {**(document.get("params") or {}), name: scaled}}


def level_bands(document: Mapping[str, Any], curve: Curve, levels: RoughnessLevels) -> F64:
    """Bands of a curve at levels of roughness.

    Args:
        document: a term of a complete look. curve: one of its model's. levels: of the samples.
    Returns:
        (L, 3, J) where the curve differs with the width, else (3, J)
    """
    if not _depends_on_roughness(document, curve, levels):
        return curve_bands(document, curve)
    return np.stack([curve_bands(scaled_roughness(document, ratio), curve) for ratio in levels.ratios])


def level_values(document: Mapping[str, Any], curve: Curve, gamma: F64, levels: RoughnessLevels) -> F64:
    """A curve at exact angles, each at a level of roughness; see `relume.brdf.curves.curve_values`.

    Args:
        document, curve, levels: as in `level_bands`. gamma: of each sample, radians. (n,)
    Returns:
        (3, n) float64
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
