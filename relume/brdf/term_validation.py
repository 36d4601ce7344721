"""Completion and validation of one term of a look against the registry of models."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from relume.brdf.curve_edits import RELATIVE, is_relative
from relume.brdf.curves import CHANNELS
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve, Term
from relume.brdf.texture_slots import check_map, check_texture
from relume.core.validation import (
    MAX_COLOR,
    Pointer,
    check_number,
    check_number_or_rgb,
    check_object,
    check_triple,
    invalid_value,
    names_text,
)

MAX_POINTS = 4096
MAX_CURVE_VALUE = 1e6
MIN_ANGLE_STEP = 1e-9  # degrees; the slopes of splines through nearer points overflow
_FIELDS = ("model", "data", "color", "texture", "roughness_map", "params", "curves")


def complete_term(pointer: Pointer, given: Any, previous: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the term with every field and parameter; missing fields have the model's defaults.

    Args:
        pointer: location of the term in its look, for the error.
        given: the received term; anything.
        previous: the valid term at this location before, if any; its unchanged curve objects are not checked again.
    Raises:
        ParameterError: something is invalid; it names the JSON pointer of the first error.
    """
    check_object(pointer, given, _FIELDS)
    model = given.get("model")
    term = TERMS.get(model) if isinstance(model, str) else None
    if term is None:
        raise invalid_value((*pointer, "model"), model, f"one of {names_text(TERMS)}")
    color = given.get("color", [1.0, 1.0, 1.0])
    check_triple((*pointer, "color"), color, 0.0, MAX_COLOR)
    texture = check_texture((*pointer, "texture"), given.get("texture", term.texture))
    previous_curves = previous["curves"] if previous is not None and previous["model"] == model else {}
    return {
        "model": model,
        **_complete_data((*pointer, "data"), given, term),
        "color": color,
        "texture": texture,
        **_complete_map((*pointer, "roughness_map"), given, term),
        "params": _complete_params((*pointer, "params"), given.get("params", {}), term),
        "curves": _complete_curves((*pointer, "curves"), given.get("curves", {}), term, previous_curves),
    }


def _complete_map(pointer: Pointer, given: Mapping[str, Any], term: Term) -> dict[str, Any]:
    """The field `roughness_map`: true to scale the width by the material's map, or an image; omitted if not given."""
    if "roughness_map" not in given:
        return {}
    roughness_map = given["roughness_map"]
    if term.width is None:
        raise invalid_value(pointer, roughness_map, f"no roughness map, because {term.model!r} has no width")
    return {"roughness_map": check_map(pointer, roughness_map)}


def _complete_data(pointer: Pointer, given: Mapping[str, Any], term: Term) -> dict[str, Any]:
    """The field `data`: the name of the measured material of the term, if its model needs one."""
    name = given.get("data")
    if term.data is None:
        if "data" in given:
            raise invalid_value(pointer, name, f"no data, because {term.model!r} has none")
        return {}
    if not isinstance(name, str) or not term.data.exists(name):
        names = names_text(term.data.list_names())
        raise invalid_value(pointer, name, f"the data of a {term.data.label} that was imported here: {names}")
    return {"data": name}


def _complete_params(pointer: Pointer, given: Any, term: Term) -> dict[str, Any]:
    check_object(pointer, given, [parameter.name for parameter in term.parameters])
    params = {}
    for parameter in term.parameters:
        value = given.get(parameter.name, parameter.default)
        check = check_number if parameter.name in term.fixed else check_number_or_rgb
        check((*pointer, parameter.name), value, parameter.minimum, parameter.maximum)
        params[parameter.name] = value
    return params


def _complete_curves(pointer: Pointer, given: Any, term: Term, previous_curves: Mapping[str, Any]) -> dict[str, Any]:
    check_object(pointer, given, [curve.name for curve in term.curves])
    for name, drawn in given.items():
        if name not in previous_curves or drawn is not previous_curves[name]:
            _check_drawn((*pointer, name), drawn, term.curve(name))
    return dict(given)


def _check_drawn(pointer: Pointer, drawn: Any, curve: Curve) -> None:
    """Check one object, or a list of objects for different channels."""
    if not isinstance(drawn, list):
        _check_drawn_object(pointer, drawn, curve)
        return
    if not 1 <= len(drawn) <= len(CHANNELS):
        raise invalid_value(pointer, drawn, "an object, or a list of one to three")
    used_channels: set[str] = set()
    for k, entry in enumerate(drawn):
        _check_drawn_object((*pointer, k), entry, curve)
        channels = entry.get("channels", CHANNELS)
        if used_channels & set(channels):
            raise invalid_value(
                (*pointer, k, "channels"), channels, "channels that no other object of this curve covers"
            )
        used_channels |= set(channels)


def _check_drawn_object(pointer: Pointer, drawn: Any, curve: Curve) -> None:
    check_object(pointer, drawn, ("points", "bands", *RELATIVE, "channels"))
    channels = drawn.get("channels", CHANNELS)
    if not isinstance(channels, str) or not channels or sorted(set(channels) & set(CHANNELS)) != sorted(channels):
        raise invalid_value((*pointer, "channels"), channels, "one or more of the letters r, g, b, each once")
    num_bases = ("points" in drawn) + ("bands" in drawn)
    if num_bases > 1 or not (num_bases or is_relative(drawn)):
        raise invalid_value(pointer, drawn, f"either points or bands, or one or more of {names_text(RELATIVE)}")
    for name in drawn:
        if name in ("points", "handles"):
            _check_points((*pointer, name), drawn[name], num_values=1 if name == "points" else 2)
        elif name != "channels":
            _check_bands((*pointer, name), drawn[name], curve.num_bands)


def _check_points(pointer: Pointer, points: Any, num_values: int) -> None:
    """Check points [degrees, value], or handles [degrees, value before, value after]."""
    form = "a point [degrees, value]" if num_values == 1 else "a handle [degrees, value before, value after]"
    if not isinstance(points, list | tuple) or not 2 <= len(points) <= MAX_POINTS:
        raise invalid_value(pointer, points, f"a list of 2 to {MAX_POINTS}, each {form}")
    for k, point in enumerate(points):
        if not isinstance(point, list | tuple) or len(point) != 1 + num_values:
            raise invalid_value((*pointer, k), point, form)
    angles, *values = zip(*points, strict=True)
    _check_values(pointer, angles, 90.0, lambda k: (k, 0))
    for column, column_values in enumerate(values, 1):
        _check_values(pointer, column_values, MAX_CURVE_VALUE, partial(_in_column, column))
    not_after = np.diff(np.asarray(angles, np.float64)) < MIN_ANGLE_STEP
    if not_after.any():
        k = int(np.argmax(not_after)) + 1
        raise invalid_value(
            (*pointer, k, 0), angles[k], f"an angle {MIN_ANGLE_STEP:g}° or more greater than that of the previous point"
        )


def _in_column(column: int, row: int) -> Pointer:
    return row, column


def _check_bands(pointer: Pointer, bands: Any, num_bands: int) -> None:
    allowed = f"{num_bands} values, three times {num_bands} values, or three lists of {num_bands}"
    if not isinstance(bands, list | tuple):
        raise invalid_value(pointer, bands, allowed)
    if len(bands) == 3 and all(isinstance(channel, list | tuple) and len(channel) == num_bands for channel in bands):
        for channel, values in enumerate(bands):
            _check_values((*pointer, channel), values, MAX_CURVE_VALUE, lambda k: (k,))
    elif len(bands) in (num_bands, 3 * num_bands):
        _check_values(pointer, bands, MAX_CURVE_VALUE, lambda k: (k,))
    else:
        raise invalid_value(pointer, bands, allowed)


def _check_values(
    pointer: Pointer, values: Sequence[Any], maximum: float, pointer_end: Callable[[int], Pointer]
) -> None:
    """Check many numbers in [0, maximum]; `pointer_end` maps the index of an invalid one to the end of its pointer."""
    in_range = set(map(type, values)) <= {int, float} and min(values) >= 0.0 and max(values) <= maximum
    if in_range and not math.isnan(sum(values)):  # min and max may miss a NaN, a sum does not
        return
    for k, value in enumerate(values):
        check_number((*pointer, *pointer_end(k)), value, 0.0, maximum)
