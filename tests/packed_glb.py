"""glTF files with geometry compressed by Draco and by meshoptimizer."""

from __future__ import annotations

import base64
import json
from functools import cache
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np
from glb_builder import Glb

# Encoded by meshoptimizer 1.3 and decoded by its reference decoder.
VECTORS: dict[str, dict[str, Any]] = {
    each["name"]: each for each in json.loads((Path(__file__).parent / "scene_io" / "meshopt_vectors.json").read_text())
}
SIDE = 7  # vertices along each side of the grid
GRID_FACES = 2 * (SIDE - 1) ** 2


def grid() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, UV coordinates and triangles of a grid in the plane z = 0 with cells of 1 × 0.5."""
    y, x = np.divmod(np.arange(SIDE * SIDE), SIDE)
    quads = np.array([[i, i + 1, i + SIDE + 1, i, i + SIDE + 1, i + SIDE] for i in range(SIDE * SIDE - SIDE - 1)])
    quads = quads[np.arange(len(quads)) % SIDE != SIDE - 1]
    positions = np.stack([x, 0.5 * y, 0 * x], -1).astype(np.float32)
    uvs = (np.stack([x, y], -1) / (SIDE - 1)).astype(np.float32)
    return positions, uvs, quads.reshape(-1, 3).astype(np.uint32)


def add_primitive_node(glb: Glb, attributes: dict[str, int], indices: int, **more: Any) -> Glb:
    """Add a node with a primitive to the document."""
    primitive = {"attributes": attributes, "indices": indices, **more}
    glb.document["meshes"] = [{"name": "grid", "primitives": [primitive]}]
    glb.document["nodes"] = [{"mesh": 0}]
    glb.document["scenes"] = [{"nodes": [0]}]
    return glb


def empty_accessor(glb: Glb, count: int, kind: str, component: int = 5126) -> int:
    glb.document["accessors"].append({"componentType": component, "count": count, "type": kind})
    return len(glb.document["accessors"]) - 1


@cache
def draco_bytes(level: int = 7) -> tuple[bytes, int]:
    """The grid encoded by Draco, with UV coordinates as attribute 7; and the number of its positions."""
    positions, uvs, faces = grid()
    options = {"quantization_bits": 14, "compression_level": level, "preserve_order": level == 0}
    compressed = DracoPy.encode(positions, faces, generic_attributes={7: uvs}, **options)
    (position_id,) = (
        each["unique_id"] for each in DracoPy.decode(compressed).attributes if each["attribute_type"] == 0
    )
    return compressed, position_id


def draco_glb(data: bytes | None = None, level: int = 7) -> Glb:
    """The grid encoded by Draco, or other data instead."""
    positions, _, faces = grid()
    compressed, position_id = draco_bytes(level)
    glb = Glb()
    view = glb.view(compressed if data is None else data)
    attributes = {
        "POSITION": empty_accessor(glb, len(positions), "VEC3"),
        "TEXCOORD_0": empty_accessor(glb, len(positions), "VEC2"),
    }
    indices = empty_accessor(glb, faces.size, "SCALAR", 5125)
    extension = {"bufferView": view, "attributes": {"POSITION": position_id, "TEXCOORD_0": 7}}
    glb.document["extensionsRequired"] = glb.document["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    return add_primitive_node(glb, attributes, indices, extensions={"KHR_draco_mesh_compression": extension})


def meshopt_glb(name: str = "EXT_meshopt_compression") -> Glb:
    """The grid encoded by meshoptimizer: exponents, octahedral normals, triangles; its second buffer is a fallback."""
    glb = Glb()

    def accessor(vector: str, kind: str, component: int, **more: Any) -> int:
        vector_entry = VECTORS[vector]
        data = base64.b64decode(vector_entry["packed"])
        view_index = glb.view(data)
        view = glb.document["bufferViews"][view_index]
        extension = {key: vector_entry[key] for key in ("mode", "count", "filter")}
        extension |= {
            "buffer": 0,
            "byteOffset": view["byteOffset"],
            "byteLength": len(data),
            "byteStride": vector_entry["stride"],
        }
        view |= {"buffer": 1, "byteOffset": 0, "byteLength": vector_entry["count"] * vector_entry["stride"]}
        view["extensions"] = {name: extension}
        if vector_entry["mode"] == "ATTRIBUTES":
            view["byteStride"] = vector_entry["stride"]
        index = empty_accessor(glb, vector_entry["count"], kind, component)
        glb.document["accessors"][index] |= {"bufferView": view_index, **more}
        return index

    attributes = {
        "POSITION": accessor("places of the grid", "VEC3", 5126),
        "NORMAL": accessor("normals of the grid", "VEC3", 5120, normalized=True),
    }
    add_primitive_node(glb, attributes, accessor("grid, 2 bytes", "SCALAR", 5123))
    glb.document["extensionsRequired"] = glb.document["extensionsUsed"] = [name, "KHR_mesh_quantization"]
    glb.document["buffers"] = [
        {"byteLength": len(glb.binary)},
        {"byteLength": 10_000, "extensions": {name: {"fallback": True}}},
    ]
    return glb
