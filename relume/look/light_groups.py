"""Validation and defaults for the light groups of a look: named sets of lights with a common gain.

    gain of a light = intensity · color · emission · (intensity · color of its group)

A light is in at most one group, and groups contain only lights. A document that has `light_groups` lists all of them: a
group that it leaves out is dissolved, also one that the scene proposes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from relume.core.errors import Description
from relume.core.validation import (
    Pointer,
    check_number,
    check_object,
    check_triple,
    invalid_value,
)
from relume.look.light_validation import LIGHT_RANGES, check_light_name
from relume.scene.model import Light
from relume.scene.validate import MAX_LIGHTS

MAX_LIGHT_GROUPS = MAX_LIGHTS
DEFAULT_GROUP: dict[str, Any] = {"lights": [], "intensity": 1.0, "color": [1.0, 1.0, 1.0], "enabled": True}


def default_light_groups(lights: Sequence[Light]) -> dict[str, Any]:
    """Return the groups that a scene proposes: those of at least two lights with the same `Light.group`."""
    members: dict[str, list[str]] = {}
    for light in lights:
        if light.group:
            members.setdefault(light.group, []).append(light.name)
    return {name: {**DEFAULT_GROUP, "lights": names} for name, names in members.items() if len(names) > 1}


def complete_light_groups(
    partial: Any, default: Mapping[str, Any], previous: Mapping[str, Any], light_names: Collection[str]
) -> dict[str, Any]:
    """Complete all light groups of a look. Raises ParameterError.

    Args:
        partial: the groups by name; a group of the scene may omit fields, also its lights.
        default: groups of the scene. previous: those of a valid look; objects shared with it are not validated again.
        light_names: lights of the look.
    """
    pointer: Pointer = ("light_groups",)
    if not isinstance(partial, Mapping):
        raise invalid_value(pointer, partial, "an object with a field for each light group")
    if len(partial) > MAX_LIGHT_GROUPS:
        value = Description(f"an object with {len(partial):,} light groups")
        raise invalid_value(pointer, value, f"at most {MAX_LIGHT_GROUPS} light groups")
    groups = {
        name: _complete_group(name, group, default.get(name), previous.get(name)) for name, group in partial.items()
    }
    _check_members(groups, light_names)
    return groups


def without_light_groups(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a complete look in which the lights themselves have the gain of their groups."""
    lights = dict(document["lights"])
    for group in document["light_groups"].values():
        for name in group["lights"]:
            light = lights[name]
            lights[name] = {
                **light,
                "intensity": light["intensity"] * group["intensity"],
                "color": [a * b for a, b in zip(light["color"], group["color"], strict=True)],
                "enabled": light["enabled"] and group["enabled"],
            }
    return {**document, "lights": lights, "light_groups": {}}


def _complete_group(name: str, partial: Any, default: Mapping[str, Any] | None, previous: Any) -> Any:
    if partial is default or partial is previous:
        return partial
    pointer: Pointer = ("light_groups", name)
    check_light_name(pointer, name)
    base = DEFAULT_GROUP if default is None else default
    check_object(pointer, partial, base)
    group = {**base, **partial}
    check_number((*pointer, "intensity"), group["intensity"], *LIGHT_RANGES["intensity"])
    check_triple((*pointer, "color"), group["color"], *LIGHT_RANGES["color"])
    if not isinstance(group["enabled"], bool):
        raise invalid_value((*pointer, "enabled"), group["enabled"], "true or false")
    names = group["lights"]
    if not isinstance(names, list | tuple) or len(names) > MAX_LIGHTS:
        raise invalid_value((*pointer, "lights"), Description("this value"), f"a list of at most {MAX_LIGHTS} lights")
    return group


def _check_members(groups: Mapping[str, Any], light_names: Collection[str]) -> None:
    """Require that each member is a light, and in one group only."""
    group_of: dict[str, str] = {}
    for group_name, group in groups.items():
        for k, name in enumerate(group["lights"]):
            pointer: Pointer = ("light_groups", group_name, "lights", k)
            if not isinstance(name, str) or name not in light_names:
                is_group = isinstance(name, str) and name in groups
                allowed = (
                    "the lights of that group; a group cannot contain groups"
                    if is_group
                    else "the name of a light of this look"
                )
                raise invalid_value(pointer, name, allowed)
            if name in group_of:
                raise invalid_value(pointer, name, f"a light in no other group; it is in {group_of[name]!r}")
            group_of[name] = group_name
