"""The lights of a look, those of sources of many one by one: for brute force, and for files of other programs."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from relume.look.model import Look, MembersLook, SingleLightLook, SurfacesLook
from relume.scene.model import Scene

_LIGHT: TypeAdapter[SingleLightLook] = TypeAdapter(SingleLightLook)


def single_lights(scene: Scene, look: Look) -> dict[str, SingleLightLook]:
    """Return all lights by unique names; those of a source have its gain, and numbers after its name.

    Args:
        scene: the scene. look: a complete look of it.
    """
    members = {light.name: light.members for light in scene.lights if light.members is not None}
    lights: dict[str, SingleLightLook] = {}
    for name, light in look.lights.items():
        if isinstance(light, MembersLook):
            singles = members[name].light_fields(light.gain)
        elif isinstance(light, SurfacesLook):
            singles = _mesh_fields(light)
        else:
            lights[name] = light
            continue
        number = 0
        for fields in singles:
            number += 1
            while f"{name} {number}" in look.lights:
                number += 1
            lights[f"{name} {number}"] = _single_light(fields)
    return lights


def _mesh_fields(light: SurfacesLook) -> list[dict[str, Any]]:
    """An emissive mesh for each material."""
    links = {"link": light.link, "shadow_link": light.shadow_link}
    return [
        {"kind": "mesh", "material": material, "emission": [g * r for g, r in zip(light.gain, relative, strict=True)]}
        | links
        for material, relative in light.materials
    ]


def _single_light(fields: dict[str, Any]) -> SingleLightLook:
    return _LIGHT.validate_python({"intensity": 1.0, "color": (1.0, 1.0, 1.0), "enabled": True, **fields})
