"""Validation and defaults for the lights of a look. A field that a light's kind does not have is an error."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from relume.assets.ies.ies_store import check_profile
from relume.brdf.texture_slots import check_image
from relume.core.errors import Description
from relume.core.validation import (
    MAX_COLOR,
    Pointer,
    check_number,
    check_object,
    check_triple,
    invalid_value,
    names_text,
)
from relume.look.link_validation import check_link
from relume.scene.light_members import MEMBER_KINDS
from relume.scene.model import Light
from relume.scene.unique_names import INHERITED_NAMES
from relume.scene.validate import (
    ENVIRONMENT,
    MAX_EMISSION,
    MAX_LIGHT_NAME,
    MAX_LIGHTS,
    MAX_METERS,
    MAX_SUN_ANGLE,
    RADIUS_RANGE,
)

MAX_INTENSITY = 1e4
MAX_GOBO_CONE = 85.0  # degrees: at 90 its image would be infinite
MIN_DIRECTION = 1e-6  # smallest allowed longest component
LIGHT_RANGES: dict[str, tuple[float, float]] = {  # of each number in a field; meters, degrees
    "intensity": (0.0, MAX_INTENSITY),
    "color": (0.0, MAX_COLOR),
    "emission": (0.0, MAX_EMISSION),
    "position": (-MAX_METERS, MAX_METERS),
    "direction": (-MAX_METERS, MAX_METERS),
    "rotation": (-360.0, 360.0),
    "size": (1e-8, 1e8),
    "radius": RADIUS_RANGE,
    "length": RADIUS_RANGE,
    "angle": (0.0, MAX_SUN_ANGLE),
    "cone": (0.0, 90.0),
}

RESERVED_LIGHT_NAMES = (ENVIRONMENT, *INHERITED_NAMES)
_WHITE = (1.0, 1.0, 1.0)
_COMMON_DEFAULTS: dict[str, Any] = {
    "intensity": 1.0,
    "color": list(_WHITE),
    "enabled": True,
    "emission": list(_WHITE),
    "link": None,
    "shadow_link": None,
}
_POSITION = {"position": [0.0, 1.0, 0.0]}
_DIRECTION = {"direction": [0.0, -1.0, 0.0]}
_KIND_DEFAULTS: dict[str, dict[str, Any]] = {
    "point": {**_POSITION, **_DIRECTION, "rotation": 0.0, "profile": None},
    "spot": {
        **_POSITION,
        **_DIRECTION,
        "cone": [20.0, 30.0],
        "rotation": 0.0,
        "profile": None,
        "gobo": None,
    },
    "directional": {**_DIRECTION, "angle": 0.0},
    "rectangle": {**_POSITION, **_DIRECTION, "rotation": 0.0, "size": [0.5, 0.5]},
    "disc": {**_POSITION, **_DIRECTION, "radius": 0.25},
    "sphere": {**_POSITION, "radius": 0.1},
    "tube": {**_POSITION, "direction": [1.0, 0.0, 0.0], "radius": 0.02, "length": 1.0},
    "mesh": {"material": "", "image": None},
    **{kind: {"source": ""} for kind in MEMBER_KINDS},
    "surfaces": {"materials": []},
}
_SOURCE_KINDS = (*MEMBER_KINDS, "surfaces")  # of many lights
_SCENE_KINDS = ("mesh", *_SOURCE_KINDS)  # where these lights are is of the scene


def default_lights(lights: Sequence[Light], material_names: Sequence[str]) -> dict[str, Any]:
    """Return the complete lights of a scene. Raises ParameterError if one is invalid."""
    documents = {}
    for light in lights:
        pointer: Pointer = ("lights", light.name)
        kind = light.fields.get("kind")
        if not isinstance(kind, str) or kind not in _KIND_DEFAULTS:
            raise invalid_value((*pointer, "kind"), kind, f"one of {names_text(_KIND_DEFAULTS)}")
        documents[light.name] = _merge(pointer, light.fields, default_light(kind))
        for material in emissive_materials(documents[light.name]):
            if material not in material_names:
                raise invalid_value((*pointer, "material"), material, names_text(material_names))
        _check_links(light.name, documents[light.name], material_names)
    return documents


def complete_lights(
    partial: Any, default: Mapping[str, Any], previous: Mapping[str, Any], material_names: Collection[str]
) -> dict[str, Any]:
    """Merge `partial` into the scene's lights and append the lights that it adds. Raises ParameterError.

    Args:
        default: default look of the scene.
        previous: a valid look; objects shared with it are not validated again.
        material_names: materials of the scene.
    """
    pointer: Pointer = ("lights",)
    if not isinstance(partial, Mapping):
        raise invalid_value(pointer, partial, "an object with a field for each light to change or to add")
    names = [*default, *(name for name in partial if name not in default)]
    if len(names) > MAX_LIGHTS:
        value = Description(f"an object with {len(names)} lights")
        raise invalid_value(pointer, value, f"at most {MAX_LIGHTS} lights, including the scene's own")
    lights = {name: _complete_light(name, partial, default.get(name), previous.get(name)) for name in names}
    for name, light in lights.items():
        if light is not previous.get(name):
            _check_links(name, light, material_names)
    _check_materials(lights, default, material_names)
    return lights


def emissive_materials(light: Mapping[str, Any]) -> list[str]:
    """Return the materials whose surfaces emit a light. light: a complete one"""
    return [light["material"]] if light["kind"] == "mesh" else [name for name, _ in light.get("materials", ())]


def _check_links(name: str, light: Mapping[str, Any], material_names: Collection[str]) -> None:
    for field in ("link", "shadow_link"):
        check_link(("lights", name, field), light.get(field), material_names)  # older stores have no links


def _check_materials(lights: Mapping[str, Any], default: Mapping[str, Any], material_names: Collection[str]) -> None:
    """Require that each mesh light that a look adds has a material of its own."""
    used = {material: name for name in default for material in emissive_materials(lights[name])}
    for name in (name for name in lights if name not in default and lights[name]["kind"] == "mesh"):
        material, pointer = lights[name]["material"], ("lights", name, "material")
        if not isinstance(material, str) or material not in material_names:
            raise invalid_value(pointer, material, f"a material of this scene: {names_text(material_names)}")
        if used.setdefault(material, name) != name:
            raise invalid_value(pointer, material, f"another material: light {used[material]!r} is of this one")


def _complete_light(name: str, lights: Mapping[str, Any], default: Any, previous: Any) -> Any:
    partial = lights.get(name, default)
    if partial is default or partial is previous:
        return partial
    pointer: Pointer = ("lights", name)
    if default is None:  # scenes of earlier versions may have other names
        check_light_name(pointer, name)
    if not isinstance(partial, Mapping):
        raise invalid_value(pointer, partial, "an object")
    return _merge(pointer, partial, _base_fields(pointer, partial, default))


def check_light_name(pointer: Pointer, name: str) -> None:
    """Require a name that a light or a light group may have. Raises ParameterError."""
    if not 1 <= len(name) <= MAX_LIGHT_NAME:
        value = Description(f"a name of {len(name)} characters")
        raise invalid_value(pointer, value, f"a name of 1 to {MAX_LIGHT_NAME} characters")
    if name in RESERVED_LIGHT_NAMES:
        raise invalid_value(pointer, name, "another name: this one is reserved")


def _base_fields(pointer: Pointer, partial: Mapping[str, Any], default: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Values for omitted fields: those of the scene's light, or the defaults of a new kind."""
    kind = partial.get("kind", default["kind"] if default else None)
    if default is not None and kind == default["kind"]:
        return {**default_light(kind), **default}  # older stores lack some fields
    if default is not None and default["kind"] in _SCENE_KINDS:
        raise invalid_value((*pointer, "kind"), kind, f"{default['kind']!r}; add a light with another name")
    kinds = [name for name in _KIND_DEFAULTS if name not in (_SOURCE_KINDS if default is None else _SCENE_KINDS)]
    if kind not in kinds:
        raise invalid_value((*pointer, "kind"), kind, f"one of {names_text(kinds)}")
    return default_light(kind)


def default_light(kind: str) -> dict[str, Any]:
    """Return the complete default light of a kind."""
    return {"kind": kind, **_COMMON_DEFAULTS, **_KIND_DEFAULTS[kind]}


def _merge(pointer: Pointer, partial: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    check_object(pointer, partial, base)
    fields = {**base, **partial}
    for field, value in fields.items():
        _check_field((*pointer, field), field, value, base)
    if fields.get("gobo") is not None and fields["cone"][1] > MAX_GOBO_CONE:
        raise invalid_value((*pointer, "cone", 1), fields["cone"][1], f"at most {MAX_GOBO_CONE:g} with a gobo")
    return fields


def _check_field(pointer: Pointer, field: str, value: Any, base: Mapping[str, Any]) -> None:
    match field:
        case "intensity" | "rotation" | "radius" | "length" | "angle":
            check_number(pointer, value, *LIGHT_RANGES[field])
        case "color" | "emission" | "position":
            check_triple(pointer, value, *LIGHT_RANGES[field])
        case "enabled":
            if not isinstance(value, bool):
                raise invalid_value(pointer, value, "true or false")
        case "direction":
            check_triple(pointer, value, *LIGHT_RANGES[field])
            if max(map(abs, value)) < MIN_DIRECTION:
                raise invalid_value(pointer, list(value), "three numbers that are not all zero")
        case "size":
            _check_pair(pointer, value, *LIGHT_RANGES[field])
        case "cone":
            _check_pair(pointer, value, *LIGHT_RANGES[field])
            if not (value[0] <= value[1] and value[1] > 0):
                raise invalid_value(
                    pointer, Description(f"{value[0]:g} and {value[1]:g}"), "inner ≤ outer, and outer above 0"
                )
        case "material":
            if base["material"] not in ("", value):
                raise invalid_value(pointer, value, f"{base['material']!r}: the scene decides which mesh emits")
        case "source":
            if base["source"] not in ("", value):
                raise invalid_value(pointer, value, f"{base['source']!r}: the scene decides which lights it has")
        case "profile":
            check_profile(pointer, value)
        case "materials":
            if base["materials"] not in ([], value):
                value_text = Description("another list")
                raise invalid_value(pointer, value_text, "that of the scene, which decides which surfaces emit")
        case "image" | "gobo":
            if value is not None:
                check_image(pointer, value)


def _check_pair(pointer: Pointer, value: Any, minimum: float, maximum: float) -> None:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise invalid_value(pointer, value, f"two numbers in [{minimum:g}, {maximum:g}]")
    for k, number in enumerate(value):
        check_number((*pointer, k), number, minimum, maximum)
