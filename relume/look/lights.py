"""The lights of a look, completed and checked; a field of another kind is an error, never ignored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, get_args

from relume.checks import MAX_COLOR, Pointer, check_number, check_object, check_triple, fail, names_text
from relume.look.model import LightKind
from relume.scene.checks import MAX_EMISSION, MAX_LIGHT_NAME, MAX_LIGHTS, MAX_METRES
from relume.scene.model import Light

MAX_SCALE = 1e4
SHORTEST_DIRECTION = 1e-6  # of its longest component
LIGHT_RANGES: dict[str, tuple[float, float]] = {  # of each number of a field; metres, degrees
    "scale": (0.0, MAX_SCALE),
    "color": (0.0, MAX_COLOR),
    "emission": (0.0, MAX_EMISSION),
    "position": (-MAX_METRES, MAX_METRES),
    "direction": (-MAX_METRES, MAX_METRES),
    "rotation": (-360.0, 360.0),
    "size": (1e-4, 1e4),
    "cone": (0.0, 90.0),
}

_WHITE = (1.0, 1.0, 1.0)
_OF_ALL: dict[str, Any] = {"scale": 1.0, "color": list(_WHITE), "on": True, "emission": list(_WHITE)}
_POSITION = {"position": [0.0, 1.0, 0.0]}
_DIRECTION = {"direction": [0.0, -1.0, 0.0]}
_OF_KIND: dict[str, dict[str, Any]] = {
    "point": _POSITION,
    "spot": {**_POSITION, **_DIRECTION, "cone": [20.0, 30.0]},
    "directional": _DIRECTION,
    "rectangle": {**_POSITION, **_DIRECTION, "rotation": 0.0, "size": [0.5, 0.5]},
    "mesh": {"material": ""},
}
_ADDABLE = [kind for kind in get_args(LightKind) if kind != "mesh"]


def default_lights(lights: Sequence[Light], material_names: Sequence[str]) -> dict[str, Any]:
    """The lights that a scene brings, complete. Raises ParameterError where one is not valid."""
    completed = {}
    for light in lights:
        pointer: Pointer = ("lights", light.name)
        kind = light.fields.get("kind")
        if not isinstance(kind, str) or kind not in _OF_KIND:
            raise fail((*pointer, "kind"), kind, f"one of {names_text(_OF_KIND)}")
        completed[light.name] = _merged(pointer, light.fields, default_light(kind))
        if kind == "mesh" and completed[light.name]["material"] not in material_names:
            raise fail((*pointer, "material"), completed[light.name]["material"], names_text(material_names))
    return completed


def complete_lights(given: Any, default: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    """The scene's own lights as `given` changes them, then those that it adds. Raises ParameterError.

    Args:
        default: of the scene. known: of a valid look; what is part of it, as an object, is not checked again.
    """
    pointer: Pointer = ("lights",)
    if not isinstance(given, Mapping):
        raise fail(pointer, given, "an object with a field for each light to change or to add")
    names = [*default, *(name for name in given if name not in default)]
    if len(names) > MAX_LIGHTS:
        raise fail(pointer, f"{len(names)} lights", f"at most {MAX_LIGHTS}, those of the scene included")
    return {name: _complete_light(name, given, default.get(name), known.get(name)) for name in names}


def _complete_light(name: str, lights: Mapping[str, Any], default: Any, known: Any) -> Any:
    given = lights.get(name, default)
    if given is default or given is known:
        return given
    pointer: Pointer = ("lights", name)
    if not 1 <= len(name) <= MAX_LIGHT_NAME:
        raise fail(pointer, f"a name of {len(name)} characters", f"a name of 1 to {MAX_LIGHT_NAME} characters")
    if not isinstance(given, Mapping):
        raise fail(pointer, given, "an object")
    return _merged(pointer, given, _start(pointer, given, default))


def _start(pointer: Pointer, given: Mapping[str, Any], default: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """What the fields that are not given are: the scene's light's, or, where the kind is new, that kind's own."""
    kind = given.get("kind", default["kind"] if default else None)
    if default is not None and kind == default["kind"]:
        return default
    if default is not None and default["kind"] == "mesh":
        raise fail((*pointer, "kind"), kind, "'mesh': these surfaces shine; add a light of another name")
    if kind not in _ADDABLE:
        raise fail((*pointer, "kind"), kind, f"one of {names_text(_ADDABLE)}")
    return default_light(kind)


def default_light(kind: str) -> dict[str, Any]:
    """A light of a kind with all that nobody has said of it, complete."""
    return {"kind": kind, **_OF_ALL, **_OF_KIND[kind]}


def _merged(pointer: Pointer, given: Mapping[str, Any], start: Mapping[str, Any]) -> dict[str, Any]:
    check_object(pointer, given, start)
    merged = {**start, **given}
    for field, value in merged.items():
        _check_field((*pointer, field), field, value, start)
    return merged


def _check_field(pointer: Pointer, field: str, value: Any, start: Mapping[str, Any]) -> None:
    match field:
        case "scale" | "rotation":
            check_number(pointer, value, *LIGHT_RANGES[field])
        case "color" | "emission" | "position":
            check_triple(pointer, value, *LIGHT_RANGES[field])
        case "on":
            if not isinstance(value, bool):
                raise fail(pointer, value, "true or false")
        case "direction":
            check_triple(pointer, value, *LIGHT_RANGES[field])
            if max(map(abs, value)) < SHORTEST_DIRECTION:
                raise fail(pointer, list(value), "three numbers that are not all zero")
        case "size":
            _check_pair(pointer, value, *LIGHT_RANGES[field])
        case "cone":
            _check_pair(pointer, value, *LIGHT_RANGES[field])
            if not (value[0] <= value[1] and value[1] > 0):
                raise fail(pointer, f"{value[0]:g} and {value[1]:g}", "inner ≤ outer, and outer above 0")
        case "material":
            if start["material"] not in ("", value):
                raise fail(pointer, value, f"{start['material']!r}: which surfaces shine is the scene's")


def _check_pair(pointer: Pointer, value: Any, minimum: float, maximum: float) -> None:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise fail(pointer, value, f"two numbers in [{minimum:g}, {maximum:g}]")
    for k, number in enumerate(value):
        check_number((*pointer, k), number, minimum, maximum)
