"""Links of lights to the object materials of a look, see `relume.look.object_materials`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def link_object_materials(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a complete look whose links name the object materials of each base material that they name."""
    names: dict[str, list[str]] = {}
    for name, material in document["materials"].items():
        base = material.get("base") if isinstance(material, Mapping) else material.base
        if base is not None:
            names.setdefault(base, []).append(name)
    if not names:
        return document
    environment, lights = document["environment"], document["lights"]
    return {
        **document,
        "environment": _linked(environment, names),
        "lights": {name: _linked(light, names) for name, light in lights.items()},
    }


def _linked(source: Mapping[str, Any], names: Mapping[str, list[str]]) -> Mapping[str, Any]:
    """Return a light or the environment with more names in its links. names: object materials by base"""
    linked = {}
    for field in ("link", "shadow_link"):
        for mode, surfaces in (source.get(field) or {}).items():
            bases = surfaces.get("materials", ())
            added = [name for base in bases for name in names.get(base, ())]
            linked[field] = {mode: {**surfaces, "materials": [*bases, *added]}}
    return {**source, **linked}
