"""Lights of a Blender scene, those of instances included."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .glb import Json
from .lights import BlenderLight, to_look

_SOFT = {"POINT": "shadow_soft_size", "SPOT": "shadow_soft_size", "SUN": "angle"}


def read_lights(context: Any) -> tuple[dict[str, Json], list[str]]:
    """Lights of a look by name of the object, and sentences about what they leave out."""
    lights, omitted, soft = dict[str, Json](), list[str](), list[str]()
    for name, source, matrix in _light_objects(context):
        light = source.data
        documents = to_look(blender_light(light, matrix), enabled=not source.hide_render)
        lights[name] = documents
        if light.type in _SOFT and getattr(light, _SOFT[light.type]) > 0:
            soft.append(name)
        if light.type == "AREA" and light.spread < 3.14:
            omitted.append(f"The spread of area light “{name}” is left out: it emits to all sides of its front.")
        if light.type == "AREA" and light.shape in ("DISK", "ELLIPSE"):
            omitted.append(f"Area light “{name}” becomes a rectangle of the area of its ellipse.")
        if light.use_nodes and any(node.type not in ("EMISSION", "OUTPUT_LIGHT") for node in light.node_tree.nodes):
            omitted.append(f"The nodes of light “{name}” are left out: it has its power and color.")
    if soft:
        examples = ", ".join(f"“{name}”" for name in soft[:3]) + (" and others" if len(soft) > 3 else "")
        omitted.append(f"Lights {examples} have sharp shadows: their size is left out. Area lights have soft ones.")
    return lights, omitted


def blender_light(light: Any, matrix: Any) -> BlenderLight:
    """A light as numbers. light: its data. matrix: of its object, to Blender's world."""
    to_world = np.array(matrix, np.float64)
    scale = np.linalg.norm(to_world[:3, :3], axis=0)
    to_world[:3, :3] /= np.maximum(scale, 1e-12)
    power = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    if not getattr(light, "normalize", True):
        power *= light.area(matrix_world=matrix)
    color = np.array(light.color)
    if getattr(light, "use_temperature", False):
        color *= np.array(light.temperature_color)
    emission = _emission_node(light)
    if emission is not None:
        power *= emission.inputs["Strength"].default_value
        color *= np.array(emission.inputs["Color"].default_value)[:3]
    shape: dict[str, Any] = {}
    if light.type == "AREA":
        height = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
        sides = float(light.size * scale[0]), float(height * scale[1])
        shape = {"size": sides, "is_round": light.shape in ("DISK", "ELLIPSE")}
    if light.type == "SPOT":
        shape = {"spot_size": light.spot_size, "spot_blend": light.spot_blend}
    red, green, blue = color.tolist()
    return BlenderLight(light.type, power, (red, green, blue), to_world, **shape)


def _emission_node(light: Any) -> Any:
    """The node whose constants multiply the light; None without nodes."""
    if not light.use_nodes or light.node_tree is None:
        return None
    return next((node for node in light.node_tree.nodes if node.type == "EMISSION"), None)


def _light_objects(context: Any) -> Iterator[tuple[str, Any, Any]]:
    """Names, objects and matrices: objects of the view layer, then lights of instances."""
    depsgraph = context.evaluated_depsgraph_get()
    for source in context.view_layer.objects:
        if source.type == "LIGHT":
            yield source.name, source, source.evaluated_get(depsgraph).matrix_world.copy()
    for number, instance in enumerate(depsgraph.object_instances):
        if instance.is_instance and instance.object.type == "LIGHT":
            yield f"{instance.object.name} (instance {number})", instance.object, instance.matrix_world.copy()
