"""Paths across the navigation map: transitions between two materials through the measured fits between them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.look.library.navigation_map import (
    MapTable,
    conductor,
    dielectric_fraction,
    navigation_map,
    reflectance,
)

F64 = NDArray[np.float64]
Terms = Sequence[Mapping[str, Any]]

_MODELS = ["lambert", "cook_torrance"]


def path_on_map(start: Terms, end: Terms, interpolated: Terms, weight: float, table: MapTable) -> Terms:
    """Interpolate two materials along a line on the map, linear in reflectance and in log roughness.

    Colors and dielectric fraction are those of the map along the line, plus the interpolated difference between each
    end's and the map's there, so that the path starts and ends at the given materials.

    Args:
        start, end: terms of complete looks. interpolated: interpolation of their parameters. weight: weight of `end`.
        table: table of the map's materials.
    Returns:
        Terms like `interpolated`; unchanged `interpolated` if an end is not a diffuse plus a Cook–Torrance term.
    """
    if not (_is_on_map(start) and _is_on_map(end) and _is_on_map(interpolated)):
        return interpolated
    plane, weights = navigation_map(table), np.array([1 - weight, weight])
    positions = np.array([_map_position(terms) for terms in (start, end)])
    position = weights @ positions
    offsets = np.array(
        [_numbers(terms) - plane.interpolate(at)[1] for terms, at in zip((start, end), positions, strict=True)]
    )
    numbers = np.maximum(plane.interpolate(position)[1] + weights @ offsets, 0)
    ior, extinction = conductor(float(position[0]), min(float(numbers[6]), 1.0))
    params = {**interpolated[1]["params"], "sigma": math.exp(position[1]), "ior": ior, "extinction": extinction}
    return [
        {**interpolated[0], "color": numbers[:3].tolist()},
        {**interpolated[1], "color": numbers[3:6].tolist(), "params": params},
    ]


def _is_on_map(terms: Terms) -> bool:
    """True for a diffuse plus a Cook–Torrance term with the same parameters in all channels."""
    if [term["model"] for term in terms] != _MODELS:
        return False
    params = terms[1]["params"]
    return all(isinstance(params[name], int | float) for name in ("sigma", "ior", "extinction")) and params["ior"] >= 1


def _map_position(terms: Terms) -> F64:
    """Position of a material on the map: (F0, log σ)."""
    params = terms[1]["params"]
    return np.array([reflectance(params["ior"], params["extinction"]), math.log(params["sigma"])])


def _numbers(terms: Terms) -> F64:
    """Interpolated numbers of a material, as in `NavigationMap`. (7,)"""
    params = terms[1]["params"]
    fraction = dielectric_fraction(params["ior"], params["extinction"])
    return np.array([*terms[0]["color"], *terms[1]["color"], fraction], np.float64)
