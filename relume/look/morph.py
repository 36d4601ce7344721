"""Looks between looks: what an animation shows from one keyframe to the next.

Numbers go evenly from one value to the other, parameters whose sliders are logarithmic evenly in their logarithm. What
has nothing between, as a model, a map or a light that only one look has, changes half way. Across the navigation map
(Sun 2007, 4.2) materials of its kind go through those that lie between them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from relume.brdf.registry import TERMS

Way = Literal["parameters", "map"]


def neighbours(num_looks: int, share: float) -> tuple[int, int, float]:
    """Find the two of some looks, at even distances, that a share of the way through them lies between.

    Args:
        num_looks: at least one. share: 0 for the first, 1 for the last.
    Returns:
        Their places, the same where it lies on one of them, and the share of the way from the one to the other.
    """
    at = share * (num_looks - 1)
    first = min(int(at), num_looks - 1)
    part = at - first
    return (first, first, 0.0) if part == 0 else (first, first + 1, part)


def morph(looks: Sequence[Mapping[str, Any]], share: float, way: Way = "parameters") -> Mapping[str, Any]:
    """The look at a share of the way through some.

    Args:
        looks: complete documents, at least one, at even distances. share: 0 for the first, 1 for the last.
        way: of materials: from parameter to parameter, or across the navigation map where both are of its kind.
    """
    first, second, part = neighbours(len(looks), share)
    if first == second:
        return looks[first]
    one, other = looks[first], looks[second]
    found: Mapping[str, Any] = _between(one, other, part)
    if way == "map":
        from relume.look.library.way import across_map  # SciPy, which a process that describes its API does without

        for name, material in found["materials"].items():
            ends = [look["materials"].get(name) for look in (one, other)]
            if None not in ends and ends[0] != ends[1]:
                between = across_map(ends[0]["terms"], ends[1]["terms"], material["terms"], part)
                found["materials"][name] = {**material, "terms": between}
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
