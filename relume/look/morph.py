"""Looks between looks: what an animation shows from one keyframe to the next.

Numbers go evenly from one value to the other, parameters whose sliders are logarithmic evenly in their logarithm. What
has nothing between, as a model, a map or a light that only one look has, changes half way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from relume.brdf.registry import TERMS


def morph(looks: Sequence[Mapping[str, Any]], share: float) -> Mapping[str, Any]:
    """The look at a share of the way through some.

    Args:
        looks: complete documents, at least one, at even distances. share: 0 for the first, 1 for the last.
    """
    at = share * (len(looks) - 1)
    first = min(int(at), len(looks) - 1)
    if first == len(looks) - 1 or at == first:
        return looks[first]
    found: Mapping[str, Any] = _between(looks[first], looks[first + 1], at - first)
    return found


def _between(one: Any, other: Any, share: float) -> Any:
    if one == other:
        return one
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        if "model" in one and "model" in other:
            return _between_terms(one, other, share)
        return _between_fields(one, other, share)
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return [_between(a, b, share) for a, b in zip(one, other, strict=True)]
    if _is_number(one) and _is_number(other):
        value = (1 - share) * one + share * other
        return round(value) if isinstance(one, int) and isinstance(other, int) else value
    return one if share < 0.5 else other


def _between_fields(one: Mapping[str, Any], other: Mapping[str, Any], share: float) -> dict[str, Any]:
    """What both have is between; all else is that of the nearer."""
    nearer = one if share < 0.5 else other
    return {
        name: _between(one[name], other[name], share) if name in one and name in other else value
        for name, value in nearer.items()
    }


def _between_terms(one: Mapping[str, Any], other: Mapping[str, Any], share: float) -> Mapping[str, Any]:
    if one["model"] != other["model"]:
        return one if share < 0.5 else other
    found = _between_fields(one, other, share)
    term = TERMS.get(one["model"])
    logarithmic = [p.name for p in term.parameters if p.scale == "log"] if term is not None else []
    for name in logarithmic:
        if name in one["params"] and name in other["params"]:
            found["params"][name] = _between_logarithms(one["params"][name], other["params"][name], share)
    return found


def _between_logarithms(one: Any, other: Any, share: float) -> Any:
    if isinstance(one, list) or isinstance(other, list):  # a value for each channel in one of them at least
        first, second = (value if isinstance(value, list) else [value] * 3 for value in (one, other))
        return [_between_logarithms(a, b, share) for a, b in zip(first, second, strict=True)]
    if one <= 0 or other <= 0:
        return (1 - share) * one + share * other
    return math.exp((1 - share) * math.log(one) + share * math.log(other))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
