"""Light mixes: brightness and color of lights by name, without materials, positions, shapes and links.

`lights` and `environment` of a light mix are a partial look.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from relume.assets.environments.environment_names import environment_exists
from relume.core.validation import invalid_value, names_text
from relume.look.model import Look

FORMAT = "relume light mix"
VERSION = 1
UNITS = {
    "point": "W/sr",
    "spot": "W/sr",
    "directional": "W/m²",
    "rectangle": "W/(sr·m²)",
    "disc": "W/(sr·m²)",
    "sphere": "W/(sr·m²)",
    "tube": "W/(sr·m²)",
    "mesh": "W/(sr·m²)",
    "points": "W/sr",
    "panels": "W/(sr·m²)",
    "directionals": "W/m²",
    "surfaces": "W/(sr·m²)",
}
"""Units of `emission` by the kind of light."""
_FIELDS = {"intensity", "color", "enabled", "emission"}


def make_light_mix(look: Look, scene_name: str) -> dict[str, Any]:
    """Return the light mix of a complete look as JSON. scene_name: for people."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "scene": scene_name,
        "units": UNITS,
        "kinds": {name: light.kind for name, light in look.lights.items()},
        "lights": {name: light.model_dump(mode="json", include=_FIELDS) for name, light in look.lights.items()},
        "light_groups": {name: group.model_dump(mode="json") for name, group in look.light_groups.items()},
        "environment": look.environment.model_dump(mode="json", exclude={"link"}),
    }


def expand_light_mix(document: Any, default: Mapping[str, Any]) -> tuple[Any, list[str]]:
    """Return the partial look of a light mix, and a sentence for each thing that the scene does not have.

    Any other document is returned as it is.

    Args:
        document: of any type, not validated. default: the default look of the scene.
    Raises:
        ParameterError: the light mix is of another version, or has no such form.
    """
    if not isinstance(document, Mapping) or document.get("format") != FORMAT:
        return document, []
    if document.get("version") != VERSION:
        raise invalid_value(("version",), document.get("version"), f"{VERSION}, the version of light mixes")
    lights, light_warnings = _expand_lights(document, default["lights"])
    environment, environment_warnings = _expand_environment(document.get("environment", {}))
    partial = {"lights": lights, **_expand_light_groups(document, default["lights"]), "environment": environment}
    return partial, [*light_warnings, *environment_warnings]


def _expand_lights(mix: Mapping[str, Any], scene_lights: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    lights, kinds = _object(mix, "lights"), _object(mix, "kinds")
    common = {name: light for name, light in lights.items() if name in scene_lights}
    differing = {name for name in common if kinds.get(name, scene_lights[name]["kind"]) != scene_lights[name]["kind"]}
    for name in differing:
        if isinstance(common[name], Mapping):  # 1 W/sr is not 1 W/m²
            common[name] = {field: value for field, value in common[name].items() if field != "emission"}
    warnings = []
    if missing := lights.keys() - common.keys():
        warnings.append(f"The light mix has values for lights that the scene does not have: {names_text(missing)}.")
    if differing:
        warnings.append(
            f"These lights are of another kind in the scene and keep its emission: {names_text(differing)}."
        )
    return common, warnings


def _expand_light_groups(mix: Mapping[str, Any], scene_lights: Mapping[str, Any]) -> dict[str, Any]:
    """Groups of the lights that the scene has; empty if the light mix, of an earlier version, has none."""
    if "light_groups" not in mix:
        return {}
    groups = {
        name: {**group, "lights": [light for light in group["lights"] if light in scene_lights]}
        if isinstance(group, Mapping) and isinstance(group.get("lights"), list)
        else group
        for name, group in _object(mix, "light_groups").items()
    }
    return {"light_groups": groups}


def _expand_environment(environment: Any) -> tuple[Any, list[str]]:
    map_name = environment.get("map") if isinstance(environment, Mapping) else None
    if not isinstance(map_name, str) or environment_exists(map_name):
        return environment, []
    known = {field: value for field, value in environment.items() if field != "map"}
    return known, [f"The environment {map_name[:80]!r} of the light mix is not available; the scene's own stays."]


def _object(mix: Mapping[str, Any], field: str) -> Mapping[str, Any]:
    value = mix.get(field, {})
    if not isinstance(value, Mapping):
        raise invalid_value((field,), value, "an object with a field for each light")
    return value
