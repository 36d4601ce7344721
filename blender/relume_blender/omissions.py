"""Sentences about parts of a Blender scene that a GLB file cannot hold, found before it is exported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any

_OBJECT_TYPES = {
    "VOLUME": "volumes", "GPENCIL": "Grease Pencil", "GREASEPENCIL": "Grease Pencil", "CURVES": "hair curves",
    "POINTCLOUD": "point clouds", "LIGHT_PROBE": "light probes", "META": "metaballs",
}  # fmt: skip
_INPUTS = (
    "Base Color", "Metallic", "Roughness", "IOR", "Alpha", "Normal", "Specular IOR Level", "Specular Tint",
    "Anisotropic", "Transmission Weight", "Coat Weight", "Coat Roughness", "Coat Normal", "Sheen Weight", "Sheen Tint",
    "Sheen Roughness", "Emission Color", "Emission Strength",
)  # fmt: skip
_WEIGHTS = {"Subsurface Weight": "subsurface scattering", "Thin Film Thickness": "thin film"}
_NODES = frozenset({
    "TEX_IMAGE", "MIX", "MIX_RGB", "MATH", "NORMAL_MAP", "SEPARATE_COLOR", "SEPRGB", "VERTEX_COLOR", "ATTRIBUTE",
    "MAPPING", "TEX_COORD", "UVMAP", "REROUTE", "RGB",
    "VALUE", "GROUP", "GROUP_INPUT", "VECT_MATH", "COMBXYZ", "SEPXYZ",
})  # fmt: skip
_MAX_NAMES = 3


def omissions(scene: Any, materials: Iterable[Any]) -> list[str]:
    """Sentences about a scene. materials: those of its objects."""
    return [*_of_objects(scene), *(sentence for material in materials for sentence in _of_material(material))]


def _of_objects(scene: Any) -> Iterator[str]:
    rendered = [each for each in scene.objects if not each.hide_render]
    by_type = Counter(_OBJECT_TYPES[each.type] for each in rendered if each.type in _OBJECT_TYPES)
    for kind, count in by_type.items():
        yield f"{count} × {kind}: glTF has none; convert them to meshes."
    hair = [each.name for each in rendered if any(s.settings.type == "HAIR" for s in each.particle_systems)]
    if hair:
        yield f"The hair of {names_text(hair)} is left out; convert it to meshes."
    flat = [each.name for each in rendered if each.type == "CAMERA" and each.data.type != "PERSP"]
    if flat:
        yield f"Cameras {names_text(flat)} are not perspective; relume shows none of them."
    blurred = [each.name for each in rendered if each.type == "CAMERA" and each.data.dof.use_dof]
    if blurred:
        yield f"The depth of field of {names_text(blurred)} is left out."
    shifted = [each.name for each in rendered if each.type == "CAMERA" and (each.data.shift_x or each.data.shift_y)]
    if shifted:
        yield f"The lens shift of {names_text(shifted)} is left out."


def _of_material(material: Any) -> Iterator[str]:
    label = f"material “{material.name}”"
    if material.library is not None:
        yield f"The {label} is linked from a library: it is sent, and changes cannot be pulled into it."
    if material.node_tree is None:
        return
    output = material.node_tree.get_output_node("ALL")
    shader = None if output is None else linked_node(output.inputs["Surface"])
    if output is not None:
        for name in ("Volume", "Displacement"):
            if output.inputs[name].is_linked:
                yield f"The {name.lower()} of {label} is left out."
    if shader is None or shader.type not in ("BSDF_PRINCIPLED", "EMISSION", "BACKGROUND"):
        kind = "no shader" if shader is None else f"the shader {shader.bl_label}"
        yield f"The {label} has {kind}, not a Principled BSDF: glTF may have nothing of it."
        return
    for name in _INPUTS:
        socket = shader.inputs.get(name)
        unknown = [] if socket is None else [node.bl_label for node in _upstream(socket) if node.type not in _NODES]
        if unknown:
            nodes = ", ".join(sorted(set(unknown)))
            yield f"{name} of {label} comes from {nodes}, which glTF cannot hold: bake it to an image."
    for name, words in _WEIGHTS.items():
        socket = shader.inputs.get(name)
        if socket is not None and (socket.is_linked or socket.default_value > 0):
            yield f"The {words} of {label} is left out."


def linked_node(socket: Any) -> Any:
    """The node that feeds a socket, beyond reroutes; None if it is not linked."""
    while socket.is_linked:
        node = socket.links[0].from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None


def _upstream(socket: Any) -> Iterator[Any]:
    """All nodes that a socket depends on."""
    pending, visited = [link.from_node for link in socket.links], set[str]()
    while pending:
        node = pending.pop()
        if node.name not in visited:
            visited.add(node.name)
            yield node
            pending += [link.from_node for inner in node.inputs for link in inner.links]


def names_text(names: list[str]) -> str:
    """A few names in quotes."""
    rest = f" and {len(names) - _MAX_NAMES} more" if len(names) > _MAX_NAMES else ""
    return ", ".join(f"“{name}”" for name in names[:_MAX_NAMES]) + rest
