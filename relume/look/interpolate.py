"""Interpolation of looks between the keyframes of an animation.

Numbers are interpolated linearly; parameters with a logarithmic slider are interpolated in the logarithm. Values that
cannot be interpolated, such as a model, a map, or a light in only one of the looks, switch half way. In mode "map",
Cook–Torrance materials follow a path across the navigation map of Ngan's fits (Sun 2007, 4.2), in mode "map_low" across
that of Löw's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from relume.brdf.registry import TERMS
from relume.look.light_groups import without_light_groups
from relume.look.light_validation import MIN_DIRECTION

InterpolationMode = Literal["parameters", "map", "map_low"]


def enclosing_keyframes(
    num_looks: int, fraction: float, durations: Sequence[float] | None = None
) -> tuple[int, int, float]:
    """Find the two keyframes that enclose a time of an animation.

    Args:
        num_looks: at least one. fraction: 0 at the first keyframe, 1 at the last.
        durations: time between keyframes, one less than these, positive, in any unit; None for equal ones.
    Returns:
        Indices of both keyframes, equal if the time is exactly at one, and the weight of the second.
    """
    position = fraction * (num_looks - 1)
    if durations is not None:
        times = np.concatenate([[0.0], np.cumsum(durations)])
        position = float(np.interp(fraction * times[-1], times, np.arange(num_looks)))
    first = min(int(position), num_looks - 1)
    weight = position - first
    return (first, first, 0.0) if weight == 0 else (first, first + 1, weight)


def interpolate_looks(
    looks: Sequence[Mapping[str, Any]], fraction: float, mode: InterpolationMode = "parameters"
) -> Mapping[str, Any]:
    """Return the look at a time of an animation.

    Args:
        looks: complete documents, at least one, equally spaced. fraction: 0 at the first, 1 at the last.
        mode: interpolate materials by their parameters, or across the navigation map if both are on it.
    """
    first, second, weight = enclosing_keyframes(len(looks), fraction)
    if first == second:
        return looks[first]
    start, end = _with_equal_groups(looks[first], looks[second])
    interpolated: Mapping[str, Any] = _interpolate(start, end, weight)
    if mode != "parameters":
        from relume.look.library.navigation_path import path_on_map  # imports SciPy, slow and rarely needed

        for name, material in interpolated["materials"].items():
            ends = [look["materials"].get(name) for look in (start, end)]
            if None not in ends and ends[0] != ends[1]:
                terms = path_on_map(
                    ends[0]["terms"], ends[1]["terms"], material["terms"], weight, "ngan" if mode == "map" else "low"
                )
                interpolated["materials"][name] = {**material, "terms": terms}
    return interpolated


def _with_equal_groups(*ends: Mapping[str, Any]) -> tuple[Mapping[str, Any], ...]:
    """Ends with the same light groups, whose gains are interpolated; in ends with others the lights have their gain."""
    members = [{name: tuple(group["lights"]) for name, group in look["light_groups"].items()} for look in ends]
    return ends if members[0] == members[1] else tuple(map(without_light_groups, ends))


def _interpolate(start: Any, end: Any, weight: float) -> Any:
    if start == end:
        return start
    if isinstance(start, Mapping) and isinstance(end, Mapping):
        if "model" in start and "model" in end:
            return _interpolate_terms(start, end, weight)
        return _interpolate_fields(start, end, weight)
    if isinstance(start, list) and isinstance(end, list) and len(start) == len(end):
        return [_interpolate(a, b, weight) for a, b in zip(start, end, strict=True)]
    if _is_number(start) and _is_number(end):
        value = _clamp((1 - weight) * start + weight * end, start, end)
        return round(value) if isinstance(start, int) and isinstance(end, int) else value
    return start if weight < 0.5 else end


def _interpolate_fields(start: Mapping[str, Any], end: Mapping[str, Any], weight: float) -> dict[str, Any]:
    """Interpolate fields that both have; other fields are those of the nearer keyframe."""
    nearest = start if weight < 0.5 else end
    fields = {
        name: _interpolate(start[name], end[name], weight) if name in start and name in end else value
        for name, value in nearest.items()
    }
    if "direction" in fields and max(map(abs, fields["direction"])) < MIN_DIRECTION:  # between opposite directions
        fields["direction"] = nearest["direction"]
    return fields


def _interpolate_terms(start: Mapping[str, Any], end: Mapping[str, Any], weight: float) -> Mapping[str, Any]:
    if start["model"] != end["model"]:
        return start if weight < 0.5 else end
    interpolated = _interpolate_fields(start, end, weight)
    term = TERMS.get(start["model"])
    logarithmic = [p.name for p in term.parameters if p.scale == "log"] if term is not None else []
    for name in logarithmic:
        if name in start["params"] and name in end["params"]:
            interpolated["params"][name] = _interpolate_log(start["params"][name], end["params"][name], weight)
    return interpolated


def _interpolate_log(start: Any, end: Any, weight: float) -> Any:
    if isinstance(start, list) or isinstance(end, list):  # at least one has a value for each channel
        first, second = (value if isinstance(value, list) else [value] * 3 for value in (start, end))
        return [_interpolate_log(a, b, weight) for a, b in zip(first, second, strict=True)]
    if start <= 0 or end <= 0:
        return _clamp((1 - weight) * start + weight * end, start, end)
    return _clamp(math.exp((1 - weight) * math.log(start) + weight * math.log(end)), start, end)


def _clamp(value: float, start: float, end: float) -> float:
    """Limit an interpolated value to its ends, which rounding may exceed."""
    return min(max(value, min(start, end)), max(start, end))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
