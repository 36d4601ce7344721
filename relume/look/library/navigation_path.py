"""Paths across the navigation map: transitions between two materials through the measured fits between them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.look.library.navigation_map import ior_from_reflectance, navigation_map, reflectance_from_ior

F64 = NDArray[np.float64]
Terms = Sequence[Mapping[str, Any]]

_MODELS = ["lambert", "cook_torrance"]


def path_on_map(start: Terms, end: Terms, interpolated: Terms, weight: float) -> Terms:
    """Interpolate two materials along a line on the map, linear in reflectance and in log roughness.

    Colors are those of the map along the line, plus the interpolated difference between each end's colors and the map's
    colors there, so that the path starts and ends at the given materials.

    Args:
        start, end: terms of complete looks. interpolated: interpolation of their parameters. weight: weight of `end`.
    Returns:
        Terms like `interpolated`; unchanged `interpolated` if an end is not a diffuse plus a Cook–Torrance term.
    """
    if not (_is_on_map(start) and _is_on_map(end) and _is_on_map(interpolated)):
        return interpolated
    end_positions = [_map_position(start), _map_position(end)]
    map_position = (1 - weight) * end_positions[0] + weight * end_positions[1]
    color_offsets = [
        _colors(terms) - _map_colors(position) for terms, position in zip((start, end), end_positions, strict=True)
    ]
    colors = np.maximum(_map_colors(map_position) + (1 - weight) * color_offsets[0] + weight * color_offsets[1], 0)
    params = {
        **interpolated[1]["params"],
        "sigma": math.exp(map_position[1]),
        "ior": ior_from_reflectance(float(map_position[0])),
    }
    return [
        {**interpolated[0], "color": colors[0].tolist()},
        {**interpolated[1], "color": colors[1].tolist(), "params": params},
    ]


def _is_on_map(terms: Terms) -> bool:
    """True for a diffuse plus a Cook–Torrance term with the same parameters in all channels."""
    if [term["model"] for term in terms] != _MODELS:
        return False
    params = terms[1]["params"]
    return all(isinstance(params[name], int | float) for name in ("sigma", "ior")) and params["ior"] >= 1


def _map_position(terms: Terms) -> F64:
    """Position of a material on the map: (F0, log σ)."""
    params = terms[1]["params"]
    return np.array([reflectance_from_ior(params["ior"]), math.log(params["sigma"])])


def _colors(terms: Terms) -> F64:
    """Colors of both terms. (2, 3)"""
    return np.array([term["color"] for term in terms], np.float64)


def _map_colors(position: F64) -> F64:
    """Colors of both terms at a position of the map. (2, 3)"""
    return _colors(navigation_map().at(float(position[0]), math.exp(position[1])))
