"""Materials of objects in an export: a file has one material for each object, which its variants replace."""

from __future__ import annotations

from collections.abc import Sequence

from relume.look import Look
from relume.look.object_materials import ObjectMaterial, object_materials_of, with_object_materials
from relume.scene.model import Scene
from relume.scene.unique_names import unique_name


def assign_in_all_looks(scene: Scene, looks: Sequence[Look]) -> tuple[Scene, list[Look]]:
    """Return a scene and looks as if its file contained the object materials of all looks.

    Objects of a material share one if they share it in each look; in looks without it, it equals its base material.

    Raises:
        ParameterError: the scene does not have an object.
    """
    owners = [{(m.base, each): m.name for m in object_materials_of(look) for each in m.objects} for look in looks]
    groups: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for base, each in sorted({key for owner in owners for key in owner}):
        shown = tuple(owner.get((base, each), base) for owner in owners)
        groups.setdefault((base, shown), []).append(each)
    if not groups:
        return scene, list(looks)
    names = dict.fromkeys((material.name for material in scene.materials), 1)
    scene_materials = tuple(names)
    materials = list[ObjectMaterial]()
    for (base, shown), objects in groups.items():
        name = unique_name(next(name for name in shown if name != base), names)
        materials.append(ObjectMaterial(name, base, tuple(objects)))
    scene_looks = list[Look]()
    for k, look in enumerate(looks):
        shown_materials = {name: look.materials[name] for name in scene_materials}
        for material, (_, shown) in zip(materials, groups, strict=True):
            fields = {"base": material.base, "objects": material.objects}
            shown_materials[material.name] = look.materials[shown[k]].model_copy(update=fields)
        # validated again, which links the object materials
        scene_looks.append(Look.model_validate({**look.model_dump(), "materials": shown_materials}))
    return with_object_materials(scene, tuple(materials)), scene_looks
