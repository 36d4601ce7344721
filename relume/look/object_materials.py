"""Object materials: materials that a look adds to a scene, for some of the objects of a material.

    "materials": {"Gold (vase)": {"base": "Gold", "objects": ["vase"], "terms": [...]}}

The surfaces of these objects that have the base material in the scene have this one instead. It begins as a copy of the
base material: with its terms, textures and maps. Links of lights that name the base material link it, too. What the
bake has decided by material is an error: glass, emissive surfaces, and mirrors (`relume.live.opened`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from relume.core.digest import digest
from relume.core.errors import Description
from relume.core.validation import Pointer, invalid_value, names_text
from relume.look.model import Look
from relume.scene.model import Scene

MAX_OBJECT_MATERIALS = 64  # each has samples, operators and tables of its own
MAX_OBJECTS = 10_000
_MAX_NAME = 1000  # characters
_FIELDS = ("base", "objects")


class ObjectMaterial(NamedTuple):
    """A material of some objects.

    Attributes:
        name: in the look. base: material of the scene. objects: names of meshes, sorted.
    """

    name: str
    base: str
    objects: tuple[str, ...]


ObjectMaterials = tuple[ObjectMaterial, ...]


def object_materials_of(look: Look) -> ObjectMaterials:
    """Return the object materials of a look, in its order."""
    return tuple(
        ObjectMaterial(name, material.base, material.objects)
        for name, material in look.materials.items()
        if material.base is not None
    )


def default_materials(partial: Mapping[str, Any], default: Mapping[str, Any]) -> dict[str, Any]:
    """Return the default materials of a scene and of the object materials of a look.

    Args:
        partial: materials of a look. default: materials of the scene's default look.
    Raises:
        ParameterError: an object material is invalid, or its base is not a material of the scene that can have some.
    """
    added = {name: fields for name, fields in partial.items() if name not in default and _is_object_material(fields)}
    if len(added) > MAX_OBJECT_MATERIALS:
        description = Description(f"an object with {len(added)} materials of objects")
        raise invalid_value(("materials",), description, f"at most {MAX_OBJECT_MATERIALS} that are not of the scene")
    owners: dict[tuple[str, str], str] = {}
    for name, fields in added.items():
        _check(("materials", name), fields, default)
        for index, each in enumerate(fields["objects"]):
            if (owner := owners.setdefault((fields["base"], each), name)) != name:
                pointer = "materials", name, "objects", index
                raise invalid_value(pointer, each, f"an object that material {owner!r} does not have")
    return {**default, **{name: {**default[fields["base"]], **_own(fields)} for name, fields in added.items()}}


def _is_object_material(fields: Any) -> bool:
    return isinstance(fields, Mapping) and "base" in fields


def _own(fields: Mapping[str, Any]) -> dict[str, Any]:
    return {name: fields[name] for name in _FIELDS}


def _check(pointer: Pointer, fields: Mapping[str, Any], default: Mapping[str, Any]) -> None:
    name, base, objects = pointer[-1], fields["base"], fields.get("objects")
    if not isinstance(name, str) or not (0 < len(name) <= _MAX_NAME and name.isprintable()):
        raise invalid_value(pointer, Description("a name"), f"a name of 1 to {_MAX_NAME} printable characters")
    if not isinstance(base, str) or base not in default:
        raise invalid_value((*pointer, "base"), base, f"a material of this scene: {names_text(default)}")
    if default[base].get("glass") is not None:
        raise invalid_value((*pointer, "base"), base, "a material without glass, whose rays the bake has traced")
    if not isinstance(objects, list | tuple) or not 0 < len(objects) <= MAX_OBJECTS:
        raise invalid_value((*pointer, "objects"), objects, f"a list of 1 to {MAX_OBJECTS} names")
    for index, each in enumerate(objects):
        if not isinstance(each, str) or len(each) > _MAX_NAME:
            raise invalid_value((*pointer, "objects", index), each, f"a name of at most {_MAX_NAME} characters")


def check_not_emissive(materials: Mapping[str, Any], emissive: Iterable[str]) -> None:
    """Require that no object material has a base that emits light. Raises ParameterError.

    Args:
        materials: complete ones of a look. emissive: materials whose surfaces emit its lights.
    """
    emissive_names = set(emissive)
    for name, fields in materials.items():
        if fields.get("base") in emissive_names:
            allowed = "a material that emits no light; the light belongs to all of its objects"
            raise invalid_value(("materials", name, "base"), fields["base"], allowed)


def check_objects(material: ObjectMaterial, owned: Collection[str]) -> None:
    """Require that all objects of an object material have its base material. Raises ParameterError.

    Args:
        material: of a look. owned: names of the objects with the base material.
    """
    if missing := set(material.objects) - set(owned):
        allowed = f"objects of material {material.base!r}: {names_text(owned)}"
        raise invalid_value(("materials", material.name, "objects"), Description(names_text(missing)), allowed)


def with_object_materials(scene: Scene, materials: ObjectMaterials) -> Scene:
    """Return a scene as if its file contained the object materials of a look; its id then begins with the scene's.

    Raises:
        ParameterError: an object does not have the base material.
    """
    if not materials:
        return scene
    index = {material.name: k for k, material in enumerate(scene.materials)}
    for material in materials:
        owned = {mesh.name for mesh in scene.meshes if mesh.material == index[material.base]}
        check_objects(material, owned)
    assigned = {
        (index[material.base], each): len(index) + k
        for k, material in enumerate(materials)
        for each in material.objects
    }
    copies = (replace(scene.materials[index[material.base]], name=material.name) for material in materials)
    return replace(
        scene,
        id=scene.id + digest(materials)[:16],
        materials=(*scene.materials, *copies),
        meshes=tuple(
            replace(mesh, material=assigned.get((mesh.material, mesh.name), mesh.material)) for mesh in scene.meshes
        ),
    )
