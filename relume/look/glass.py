"""Glass of a look: validation, and scenes with it.

A look edits the glass that a scene has: what transmits, and whether it is solid, is a matter of geometry. Fields that a
material's glass does not have are an error: opaque materials have no glass, and thin glass absorbs by its color alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from relume.core.digest import digest
from relume.core.errors import Description, ParameterError
from relume.core.validation import Pointer, check_number, check_object, check_triple, pointer_text
from relume.look.model import GlassLook, Look
from relume.scene.model import Glass, Material, Scene
from relume.scene.validate import MAX_IOR

GLASS_RANGES: dict[str, tuple[float, float]] = {  # of each number in a field; absorption per meter
    "color": (0.0, 1.0),
    "absorption": (0.0, 1e6),
    "roughness": (0.0, 1.0),
    "ior": (1.0, MAX_IOR),
}
_TRIPLES = ("color", "absorption")

GlassOfLook = tuple[tuple[str, GlassLook], ...]
"""Glass by the names of its materials, in the scene's order."""


def default_glass(glass: Glass) -> dict[str, Any]:
    """Return the document of a scene's glass; only solids have an absorption."""
    absorption = {"absorption": [*map(float, glass.absorbed)]} if glass.thickness > 0 else {}
    return {"color": [*map(float, glass.tint)], **absorption, "roughness": glass.roughness, "ior": glass.ior}


def complete_glass(pointer: Pointer, partial: Any, default: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the complete glass of a material.

    Args:
        pointer: location in the look. partial: fields to change. default: the scene's; None: it is opaque.
    Raises:
        ParameterError: a value is invalid, or the material is opaque.
    """
    if default is None:
        able = "left out, since this material transmits no light in the scene, or the bake is of an earlier version"
        raise ParameterError(pointer_text(pointer), Description("glass"), able)
    check_object(pointer, partial, default)
    fields = {**default, **partial}
    for name, value in fields.items():
        check = check_triple if name in _TRIPLES else check_number
        check((*pointer, name), value, *GLASS_RANGES[name])
    return fields


def glass_of(look: Look) -> GlassOfLook:
    """Return all glass of a look."""
    return tuple((name, material.glass) for name, material in look.materials.items() if material.glass is not None)


def with_glass(scene: Scene, glass: GlassOfLook) -> Scene:
    """Return a scene as if its file contained the glass of a look; its id then begins with the scene's."""
    by_name = dict(glass)
    materials = tuple(with_glass_look(material, by_name.get(material.name)) for material in scene.materials)
    if all(material is own for material, own in zip(materials, scene.materials, strict=True)):
        return scene
    identity = digest([(name, each.model_dump()) for name, each in glass])[:16]
    return replace(scene, id=scene.id + identity, materials=materials)


def with_glass_look(material: Material, glass: GlassLook | None) -> Material:
    """Return a material with the glass of a look; itself if it is opaque or has that glass."""
    if glass is None or material.glass is None:
        return material
    edited = replace(
        material.glass, tint=glass.color, absorbed=glass.absorption, ior=glass.ior, roughness=glass.roughness
    )
    return material if edited == material.glass else replace(material, glass=edited)
