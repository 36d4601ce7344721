"""Runs in the Python that has bpy: a small scene with materials, all kinds of lights, a world and a camera."""

import json
import math

import bpy


def make_scene() -> None:
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=6)
    bpy.context.object.data.materials.append(material("Floor", (0.5, 0.5, 0.5), 0.8))
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 0.5))
    bpy.context.object.data.materials.append(material("Ball", (0.8, 0.2, 0.1), 0.35))
    light("Key", "POINT", (1, -2, 2), energy=60, color=(0.5, 0.4, 0.3), shadow_soft_size=0)
    light("Panel", "AREA", (-2, -1, 2), (0.3, -0.8, 0.4), energy=40, shape="RECTANGLE", size=1, size_y=0.5)
    light("Sun", "SUN", (0, 0, 5), (0.3, 0.2, 0), energy=0.5, angle=0)
    light("Spot", "SPOT", (0, 2, 3), (-0.5, 0, 0), energy=80, spot_size=0.8, spot_blend=0.3, shadow_soft_size=0)
    camera = bpy.data.objects.new("Cam", bpy.data.cameras.new("Cam"))
    camera.location, camera.rotation_euler = (0, -5, 1.6), (math.radians(78), 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = node_of(scene.world, "BACKGROUND")
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (0.2, 0.3, 0.5, 1), 0.5
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    bpy.context.view_layer.update()


def material(name: str, color: tuple[float, float, float], roughness: float, **inputs: float) -> bpy.types.Material:
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = node_of(made, "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value, shader.inputs["Roughness"].default_value = (*color, 1), roughness
    for label, value in inputs.items():
        shader.inputs[label.replace("_", " ")].default_value = value
    return made


def light(name, kind, location, rotation=(0, 0, 0), **fields) -> bpy.types.Object:
    data = bpy.data.lights.new(name, kind)
    for field, value in fields.items():
        setattr(data, field, value)
    made = bpy.data.objects.new(name, data)
    made.location, made.rotation_euler = location, rotation
    bpy.context.scene.collection.objects.link(made)
    return made


def node_of(owner, kind: str):
    return next(node for node in owner.node_tree.nodes if node.type == kind)


def values(name: str) -> dict:
    """Constants of a material's Principled BSDF."""
    sockets = node_of(bpy.data.materials[name], "BSDF_PRINCIPLED").inputs
    return {
        s.name: list(s.default_value) if s.type == "RGBA" else s.default_value
        for s in sockets
        if s.type in ("RGBA", "VALUE")
    }


def lights() -> dict:
    """Power, color, place and shape of all lights."""
    fields = "energy", "size", "size_y", "spot_size", "spot_blend"
    return {
        each.name: {
            "color": list(each.data.color), "matrix": [list(row) for row in each.matrix_world],
            "hidden": each.hide_render,
            **{field: getattr(each.data, field) for field in fields if hasattr(each.data, field)},
        }
        for each in bpy.data.objects if each.type == "LIGHT"
    }  # fmt: skip


def run(operator: str) -> dict:
    """Run an operator; its status and what it left out."""
    manager = bpy.context.window_manager
    manager.relume_status = manager.relume_omitted = ""
    try:
        getattr(bpy.ops.relume, operator)()
    except RuntimeError as error:  # bpy's form of reported errors
        if "Traceback" in str(error):
            raise
    omitted = json.loads(manager.relume_omitted or "[]")
    return {"status": manager.relume_status, "omitted": omitted, "sent": bpy.context.scene.relume.sent}
