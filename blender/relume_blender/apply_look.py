"""A pulled look into the open .blend file: materials and lights."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from .exchange import PulledLook, is_changed
from .glb import Json
from .lights import BlenderLight, from_look
from .omissions import linked_node
from .snapshot import Sent
from .surfaces import Value

_TOLERANCE = 1e-4
_DISK = 2 / math.sqrt(math.pi)


def apply_look(scene: Any, sent: Sent, look: PulledLook) -> list[str]:
    """Change materials and lights of a scene.

    Args:
        scene: of Blender. sent: its record. look: to be applied.
    Returns:
        Sentences about what could not be changed.
    """
    omitted = list[str]()
    for name, values in look.materials.items():
        omitted += _apply_material(sent.materials.get(name), name, values)
    for name, (before, after) in look.lights.items():
        omitted += _apply_light(scene, sent.lights.get(name), name, before, after)
    for name in look.removed:
        removed = scene.objects.get(sent.lights.get(name, ""))
        if removed is not None:
            removed.hide_render = removed.hide_viewport = True
            omitted.append(f"Light “{removed.name}” is not part of the look: it is hidden.")
    return omitted


def _apply_material(blender_name: str | None, name: str, values: dict[str, Value] | Any) -> list[str]:
    material = None if blender_name is None else bpy.data.materials.get(blender_name)
    if material is None:
        return [f"There is no material “{name}” any more: its changes are left out."]
    if material.library is not None:
        return [f"Material “{name}” is linked from a library: its changes are left out."]
    output = None if material.node_tree is None else material.node_tree.get_output_node("ALL")
    shader = None if output is None else linked_node(output.inputs["Surface"])
    if shader is None or shader.type != "BSDF_PRINCIPLED":
        return [f"Material “{name}” has no Principled BSDF: its changes are left out."]
    omitted = []
    for socket_name, value in values.items():
        socket = shader.inputs.get(socket_name)
        if socket is not None and not _set_socket(material.node_tree, socket, value):
            omitted.append(f"{socket_name} of material “{name}” comes from nodes: its change is left out.")
    return omitted


def _set_socket(tree: Any, socket: Any, value: Value) -> bool:
    """Set a constant, or the factor of an image; false if other nodes feed the socket."""
    node = linked_node(socket)
    if node is None:
        _assign(socket, value)
        return True
    is_color = socket.type == "RGBA"
    factor = _factor_socket(node, is_color=is_color)
    if factor is None and node.type in ("TEX_IMAGE", "SEPARATE_COLOR", "VERTEX_COLOR"):
        if np.allclose(value, 1.0, atol=_TOLERANCE):
            return True
        factor = _insert_factor(tree, socket, is_color=is_color)
    if factor is None:
        return False
    _assign(factor, value)
    return True


def _assign(socket: Any, value: Value) -> None:
    """Set a constant unless it is the same; a color keeps its alpha."""
    former = socket.default_value
    if isinstance(value, tuple):
        if not np.allclose(former[:3], value, rtol=_TOLERANCE, atol=_TOLERANCE):
            socket.default_value = (*value, former[3])
    elif not np.isclose(former, value, rtol=_TOLERANCE, atol=_TOLERANCE):
        socket.default_value = value


def _factor_socket(node: Any, *, is_color: bool) -> Any:
    """The constant of a node that multiplies an image, as Blender's glTF exporter reads it; None for other nodes."""
    if is_color and node.type == "MIX" and node.data_type == "RGBA" and node.blend_type == "MULTIPLY":
        sockets = [each for each in node.inputs if each.enabled and each.type == "RGBA"]
    elif not is_color and node.type == "MATH" and node.operation == "MULTIPLY":
        sockets = [*node.inputs[:2]]
    else:
        return None
    constants = [each for each in sockets if not each.is_linked]
    return constants[0] if len(constants) == 1 else None


def _insert_factor(tree: Any, socket: Any, *, is_color: bool) -> Any:
    """Insert a node that multiplies what feeds a socket; returns its constant."""
    source = socket.links[0].from_socket
    node = tree.nodes.new("ShaderNodeMix" if is_color else "ShaderNodeMath")
    node.location = socket.node.location.x - 200, socket.node.location.y
    if is_color:
        node.data_type, node.blend_type = "RGBA", "MULTIPLY"
        node.inputs["Factor"].default_value = 1.0
        colors = [each for each in node.inputs if each.enabled and each.type == "RGBA"]
        result = next(each for each in node.outputs if each.enabled)
    else:
        node.operation, colors, result = "MULTIPLY", [*node.inputs[:2]], node.outputs[0]
    tree.links.new(source, colors[0])
    tree.links.new(result, socket)
    return colors[1]


def _apply_light(scene: Any, blender_name: str | None, name: str, before: Json | None, after: Json) -> list[str]:
    source = None if blender_name is None else scene.objects.get(blender_name)
    if source is None and before is not None:
        return [f"There is no light “{name}” of its own any more: its changes are left out."]
    if source is not None and source.data.library is not None:
        return [f"Light “{name}” is linked from a library: its changes are left out."]
    if source is None:
        source = bpy.data.objects.new(name, bpy.data.lights.new(name, from_look(after).type))
        scene.collection.objects.link(source)
    changed = is_changed(before, after)
    target = from_look(after)
    light = source.data
    if "type" in changed:
        light.type = target.type
        light = source.data  # of the new type
        if before is None and hasattr(light, "shadow_soft_size"):
            light.shadow_soft_size = 0.0
    _set_strength(light, None if before is None else from_look(before), target, changed)
    _set_shape(light, target, changed, source)
    if "to_world" in changed:
        source.matrix_world = _placed(source.matrix_world, target)
    if before is None or before["enabled"] != after["enabled"]:
        source.hide_render = not after["enabled"]
    return []


def _placed(former: Any, target: BlenderLight) -> Any:
    """The matrix of a moved light; a point light has no direction, a sun no position, so that they keep theirs."""
    position, rotation, scale = former.decompose()
    matrix = Matrix(target.to_world.tolist())
    return Matrix.LocRotScale(
        position if target.type == "SUN" else matrix.to_translation(),
        rotation if target.type == "POINT" else matrix.to_3x3(),
        scale,
    )


def _set_strength(light: Any, before: BlenderLight | None, target: BlenderLight, changed: set[str]) -> None:
    """Set power and color: a change of power alone is a factor, so that exposure and nodes of the light stay."""
    if changed & {"color", "type"}:
        light.color = target.color
        light.energy = target.power
        for name, value in {"use_temperature": False, "exposure": 0.0, "normalize": True}.items():
            if hasattr(light, name):
                setattr(light, name, value)
        light.use_nodes = False
    elif "power" in changed:
        is_factor = before is not None and before.power > 0
        light.energy = light.energy * target.power / before.power if is_factor else target.power  # type: ignore[union-attr]


def _set_shape(light: Any, target: BlenderLight, changed: set[str], source: Any) -> None:
    if light.type == "SPOT" and changed & {"spot_size", "spot_blend", "type"}:
        light.spot_size, light.spot_blend = target.spot_size, target.spot_blend
    if light.type == "AREA" and changed & {"size", "type"}:
        is_round = light.shape in ("DISK", "ELLIPSE")
        light.shape = "ELLIPSE" if is_round else "RECTANGLE"
        scale, factor = source.matrix_world.to_scale(), _DISK if is_round else 1.0
        light.size, light.size_y = (side * factor / max(s, 1e-12) for side, s in zip(target.size, scale, strict=False))
