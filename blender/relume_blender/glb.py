"""GLB files on their way: names that a server keeps, lights, and what has changed since the last file.

glTF 2.0 specification, section 4, and KHR_lights_punctual.
"""

from __future__ import annotations

import copy
import hashlib
import json
import re
import struct
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Json = dict[str, Any]

LUMENS_PER_WATT = 683.0
"""Of a server's reader, which divides by it."""
_PUNCTUAL = "KHR_lights_punctual"
_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"
_MAX_NAME = 60
_SLUG = 34
_MIN_CONE = 1e-6  # radians; in glTF the inner half-angle of a spot is smaller than the outer
_FACTORS = ("baseColorFactor", "metallicFactor", "roughnessFactor")
_LAYERS = tuple(f"KHR_materials_{name}" for name in ("ior", "specular", "clearcoat", "sheen", "anisotropy"))
_STRENGTH = "KHR_materials_emissive_strength"


@dataclass(frozen=True)
class Glb:
    """A document of glTF and its binary chunk."""

    document: Json
    binary: bytes

    @classmethod
    def from_bytes(cls, data: bytes) -> Glb:
        """Read a file. Raises ValueError if it is not a GLB file."""
        if data[:4] != _MAGIC or len(data) < 20:
            raise ValueError("the file is not GLB")
        chunks, offset = dict[bytes, bytes](), 12
        while offset + 8 <= len(data):
            length, kind = struct.unpack_from("<I4s", data, offset)
            chunks.setdefault(kind, data[offset + 8 : offset + 8 + length])
            offset += 8 + length
        if _JSON not in chunks:
            raise ValueError("the file is not GLB: it has no document")
        return cls(json.loads(chunks[_JSON]), chunks.get(_BINARY, b""))

    def to_bytes(self) -> bytes:
        """Write a file."""
        text = json.dumps(self.document, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")
        chunks = [(_JSON, text + b" " * (-len(text) % 4)), (_BINARY, self.binary + b"\0" * (-len(self.binary) % 4))]
        body = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks if data)
        return struct.pack("<4sII", _MAGIC, 2, 12 + len(body)) + body


def unique_names(names: Iterable[str], used: Iterable[str] = (), separator: str = " ") -> list[str]:
    """Names that a server keeps as they are: printable, without / and ~, of 1 to 60 characters, and unique.

    Args:
        names: any. used: those that are taken. separator: text before the number of an equal name.
    """
    taken, unique = set(used), list[str]()
    for name in names:
        printable = "".join(c for c in unicodedata.normalize("NFC", name) if c.isprintable())
        plain = printable.replace("/", "-").replace("~", "-").strip()[:_MAX_NAME].strip() or "unnamed"
        number, candidate = 1, plain
        while candidate in taken:
            number += 1
            candidate = f"{plain}{separator}{number}"
        taken.add(candidate)
        unique.append(candidate)
    return unique


def slugs(names: Iterable[str]) -> list[str]:
    """Names of cameras that a server keeps as they are: unique, of a to z, 0 to 9 and hyphens."""
    ascii_names = (unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower() for name in names)
    plain = [re.sub(r"[^a-z0-9]+", "-", name).strip("-")[: _SLUG - 4].strip("-") or "view" for name in ascii_names]
    return unique_names(plain, separator="-")


def add_lights(document: Json, lights: Mapping[str, Mapping[str, Any]]) -> None:
    """Add the point, spot and directional lights of a look to a document; rectangles are in the look alone."""
    definitions, nodes = list[Json](), document.setdefault("nodes", [])
    for name, light in lights.items():
        if light["kind"] == "rectangle" or not light["enabled"]:
            continue
        strength = light["emission"][0] * max(light["color"])
        peak = max(*light["color"], 1e-30)
        fields: Json = {"name": name, "type": light["kind"], "intensity": strength * LUMENS_PER_WATT}
        fields["color"] = [channel / peak for channel in light["color"]]
        if light["kind"] == "spot":
            inner, outer = np.radians(light["cone"]).tolist()
            fields["spot"] = {"innerConeAngle": max(min(inner, outer - _MIN_CONE), 0.0), "outerConeAngle": outer}
        node = {"name": name, "matrix": _matrix(light), "extensions": {_PUNCTUAL: {"light": len(definitions)}}}
        definitions.append(fields)
        document["scenes"][document.get("scene", 0)].setdefault("nodes", []).append(len(nodes))
        nodes.append(node)
    if definitions:
        document.setdefault("extensions", {})[_PUNCTUAL] = {"lights": definitions}
        document["extensionsUsed"] = sorted({*document.get("extensionsUsed", ()), _PUNCTUAL})


def remove_empty_nodes(document: Json) -> None:
    """Remove nodes that hold nothing, as Blender's exporter leaves them of lights."""
    while True:
        nodes = document.get("nodes", [])
        full = [k for k, node in enumerate(nodes) if node.keys() & {"mesh", "camera", "children", "extensions"}]
        if len(full) == len(nodes):
            return
        numbers = {index: number for number, index in enumerate(full)}
        document["nodes"] = [nodes[index] for index in full]
        for parent, member in [
            *((n, "children") for n in document["nodes"]),
            *((s, "nodes") for s in document["scenes"]),
        ]:
            if member in parent:
                parent[member] = [numbers[index] for index in parent[member] if index in numbers]
                if not parent[member]:
                    del parent[member]


def _matrix(light: Mapping[str, Any]) -> list[float]:
    """Column-major; −Z is the direction of the light."""
    backward = -np.array(light.get("direction", (0.0, 0.0, -1.0)), np.float64)
    backward /= np.linalg.norm(backward)
    right = np.cross(np.eye(3)[np.argmin(np.abs(backward))], backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(backward, right), backward, light.get("position", (0.0, 0.0, 0.0))])
    return [float(value) for value in matrix.T.ravel()]


def scene_key(glb: Glb) -> str:
    """Hash of all that a look cannot change: geometry, images, cameras, and which textures a material has."""
    document = copy.deepcopy(glb.document)
    document.pop("extensionsUsed", None)
    colored = {
        primitive.get("material")
        for mesh in document.get("meshes", ())
        for primitive in mesh["primitives"]
        if "COLOR_0" in primitive["attributes"]
    }
    for index, material in enumerate(document.get("materials", ())):
        if index not in colored:
            _remove_editable(material)
    text = json.dumps(document, sort_keys=True).encode("utf-8", "replace")
    return hashlib.sha256(text + b"\0" + glb.binary).hexdigest()


def _remove_editable(material: Json) -> None:
    """Remove the factors that a look replaces: none of glass, nor of metalness that is part of textures."""
    pbr, extensions = material.get("pbrMetallicRoughness", {}), material.get("extensions", {})
    if "KHR_materials_transmission" in extensions:
        return
    has_texture = any(name.endswith("Texture") for name in pbr)
    for name in _FACTORS:
        if name == "baseColorFactor" and len(pbr.get(name, ())) == 4:
            pbr[name] = pbr[name][3]
        elif name != "metallicFactor" or not has_texture:
            pbr.pop(name, None)
    if "emissiveTexture" not in material:
        material.pop("emissiveFactor", None)
        extensions.pop(_STRENGTH, None)
    for name in _LAYERS:
        if not any(member.endswith("Texture") for member in extensions.get(name, {})):
            extensions.pop(name, None)
    if not extensions:
        material.pop("extensions", None)


def material_swatches(glb: Glb) -> Glb:
    """The materials and images of a file, each material on a triangle."""
    document, binary = glb.document, bytearray()
    views, images = list[Json](), [dict(image) for image in document.get("images", ())]
    for image in images:
        if "bufferView" in image:
            view = document["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            image["bufferView"] = _append(views, binary, glb.binary[start : start + view["byteLength"]])
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    arrays = {"POSITION": corners, "NORMAL": np.tile(np.array([0, 0, 1], "<f4"), (3, 1)), "TEXCOORD_0": corners[:, :2]}
    accessors = list[Json]()
    for array in arrays.values():
        view_index = _append(views, binary, np.ascontiguousarray(array).tobytes())
        accessors.append({
            "bufferView": view_index, "componentType": 5126, "count": 3, "type": f"VEC{array.shape[1]}",
            "min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist(),
        })  # fmt: skip
    attributes = {name: index for index, name in enumerate(arrays)}
    materials = document.get("materials", [])
    primitives = [{"attributes": attributes, "material": index} for index in range(len(materials))]
    shared: Json = {name: document[name] for name in ("textures", "samplers", "extensionsUsed") if name in document}
    return Glb(
        {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": primitives}], "materials": materials, **({"images": images} if images else {}),
            **shared, "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(binary)}],
        },
        bytes(binary),
    )  # fmt: skip


def _append(views: list[Json], binary: bytearray, data: bytes) -> int:
    views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
    binary += data + b"\0" * (-len(data) % 4)
    return len(views) - 1
