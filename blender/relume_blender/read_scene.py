"""A Blender scene as a snapshot: GLB by Blender's exporter, world, lights, cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from .omissions import omissions
from .read_lights import read_lights
from .read_world import write_world
from .snapshot import Snapshot, make_snapshot

_TONE_MAPS = {"AgX": "agx", "Filmic": "filmic", "Standard": "none", "Raw": "none"}
_EXPORT = {
    "export_format": "GLB", "use_active_scene": True, "use_renderable": True, "export_apply": True,
    "export_cameras": True, "export_lights": False, "export_animations": False, "export_skins": False,
    "export_morph": False, "export_gn_mesh": True, "export_extras": False, "export_yup": True,
    "export_materials": "EXPORT",
}  # fmt: skip


def read_scene(context: Any, folder: Path) -> Snapshot:
    """Return the active scene as a renderer has it, with modifiers applied.

    Args:
        context: Blender's. folder: an empty one, for files.
    Raises:
        RuntimeError: Blender cannot export or render; its message says why. ValueError: nothing can be shown.
    """
    scene = context.scene
    if not any(each.type in ("MESH", "CURVE", "SURFACE", "FONT") or each.is_instancer for each in scene.objects):
        raise ValueError("The scene has no surfaces to show: add a mesh.")
    path = folder / "scene.glb"
    bpy.ops.export_scene.gltf(filepath=str(path), **_EXPORT)
    environment = folder / "world.exr"
    world = write_world(context, environment)
    lights, light_sentences = read_lights(context)
    camera = scene.camera.data.name if scene.camera is not None and scene.camera.type == "CAMERA" else None
    display = {
        "exposure": min(max(scene.view_settings.exposure, -20.0), 20.0),
        "tone_map": _TONE_MAPS.get(scene.view_settings.view_transform, "agx"),
    }
    sections = {"display": display, "environment": {"intensity": world.intensity}}
    sentences = (*omissions(scene, used_materials(scene)), *world.omitted, *light_sentences)
    return make_snapshot(scene.name, path.read_bytes(), (environment, world.key), lights, sections, camera, sentences)


def used_materials(scene: Any) -> list[Any]:
    """Materials of the objects of a scene, once each."""
    slots = (slot.material for each in scene.objects for slot in each.material_slots)
    return list(dict.fromkeys(material for material in slots if material is not None))
