"""Ways across the navigation map: what a material shows on its way to another, through the fits that lie between."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.look.library.navigation import ior_of, navigation_map, reflectance_of

F64 = NDArray[np.float64]
Terms = Sequence[Mapping[str, Any]]

_MODELS = ["lambert", "cook_torrance"]


def across_map(one: Terms, other: Terms, between: Terms, share: float) -> Terms:
    """Go from a material to another across the map: straight in reflectance and in the logarithm of roughness.

    The colours are those of the map's materials on the way; what the two ends differ by from the map's own there is
    taken along, less and less of the one and more and more of the other, so that the way begins and ends at them.

    Args:
        one, other: terms of complete looks. between: what they are from parameter to parameter.
        share: of the way.
    Returns:
        Terms like `between`, and those themselves where either end is not a diffuse and a Cook-Torrance term.
    """
    if not (_is_of_map(one) and _is_of_map(other) and _is_of_map(between)):
        return between
    ends = [_place(one), _place(other)]
    here = (1 - share) * ends[0] + share * ends[1]
    beside = [_colors(terms) - _map_colors(place) for terms, place in zip((one, other), ends, strict=True)]
    colors = np.maximum(_map_colors(here) + (1 - share) * beside[0] + share * beside[1], 0)
    params = {**between[1]["params"], "sigma": math.exp(here[1]), "ior": ior_of(float(here[0]))}
    return [
        {**between[0], "color": colors[0].tolist()},
        {**between[1], "color": colors[1].tolist(), "params": params},
    ]


def _is_of_map(terms: Terms) -> bool:
    """Whether they are a diffuse and a Cook-Torrance term whose parameters are the same in all channels."""
    if [term["model"] for term in terms] != _MODELS:
        return False
    params = terms[1]["params"]
    return all(isinstance(params[name], int | float) for name in ("sigma", "ior")) and params["ior"] >= 1


def _place(terms: Terms) -> F64:
    """Where a material lies on the map: (F0, log σ)."""
    params = terms[1]["params"]
    return np.array([reflectance_of(params["ior"]), math.log(params["sigma"])])


def _colors(terms: Terms) -> F64:
    """Of both terms. (2, 3)"""
    return np.array([term["color"] for term in terms], np.float64)


def _map_colors(place: F64) -> F64:
    """Of both terms of the map's material at a place. (2, 3)"""
    return _colors(navigation_map().at(float(place[0]), math.exp(place[1])))
