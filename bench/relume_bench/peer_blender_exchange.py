"""Runs in the Python that has bpy: one phase of export.blender_error.

`send URL FOLDER COUNT` makes a scene of so many materials and sends it; `pull URL FOLDER LINK` pulls a look into it.
Both write the values of materials and lights to FOLDER/PHASE.json.
"""

import json
import sys
from pathlib import Path
from typing import Any

import bpy

import relume_blender

LIGHTS: dict[str, dict[str, float]] = {
    "POINT": {"energy": 60.0, "shadow_soft_size": 0.0},
    "SPOT": {"energy": 80.0, "spot_size": 0.8, "shadow_soft_size": 0.0},
    "SUN": {"energy": 0.5, "angle": 0.0},
    "AREA": {"energy": 40.0, "size": 0.7},
}


def main(phase: str, url: str, folder: str, argument: str) -> None:
    """Run a phase: "send" or "pull", with the server's url, the folder of files, and the argument: COUNT or LINK."""
    relume_blender.register()
    if phase == "send":
        bpy.ops.wm.read_factory_settings(use_empty=True)
        make_scene(int(argument))
    else:
        bpy.ops.wm.open_mainfile(filepath=f"{folder}/scene.blend")
        bpy.context.scene.relume.look = argument
    addons = bpy.context.preferences.addons
    if "relume_blender" not in addons:
        addons.new().module = "relume_blender"
    addons["relume_blender"].preferences.url = url
    getattr(bpy.ops.relume, phase)()
    bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/scene.blend")
    Path(folder, f"{phase}.json").write_text(json.dumps(state()))


def make_scene(count: int) -> None:
    """Triangles of materials, half of which are metal, below four lights."""
    for number in range(count):
        share = number / max(count - 1, 1)
        material = bpy.data.materials.new(f"Material {number}")
        material.use_nodes = True
        inputs = shader_of(material).inputs
        inputs["Base Color"].default_value = (0.1 + 0.8 * share, 0.9 - 0.8 * share, 0.3, 1)
        inputs["Roughness"].default_value = 0.1 + 0.8 * (1 - share)
        inputs["Metallic"].default_value = float(number % 2)
        bpy.ops.mesh.primitive_plane_add(size=1, location=(number % 4, number // 4, 0))
        bpy.context.object.data.materials.append(material)
    for kind, fields in LIGHTS.items():
        light = bpy.data.lights.new(kind, kind)
        for field, value in fields.items():
            setattr(light, field, value)
        source = bpy.data.objects.new(kind, light)
        source.location = (1, 1, 3)
        bpy.context.scene.collection.objects.link(source)
    bpy.context.scene.relume.method, bpy.context.scene.relume.preset = "direct", "preview"
    bpy.context.view_layer.update()


def shader_of(material: Any) -> Any:
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def state() -> dict[str, Any]:
    """Values of materials and lights, and the record of what was sent."""
    materials = {}
    for material in bpy.data.materials:
        inputs = shader_of(material).inputs
        color = list(inputs["Base Color"].default_value)[:3]
        materials[material.name] = {
            "Base Color": color, "Roughness": inputs["Roughness"].default_value,
            "Metallic": inputs["Metallic"].default_value,
        }  # fmt: skip
    lights = {each.name: {"power": each.data.energy} for each in bpy.data.objects if each.type == "LIGHT"}
    return {"materials": materials, "lights": lights, "sent": json.loads(bpy.context.scene.relume.sent)}


if __name__ == "__main__":
    main(*sys.argv[1:])
