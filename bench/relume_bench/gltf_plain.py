"""Read a glTF file as plain arrays for a peer: an independent, short reader that reveals errors of the importer.

Shares nothing with `relume.scene`. Triangles only; nothing is validated, the files are known. Incomplete triangles and
extensions that are not objects are left out.
"""

from __future__ import annotations

import base64
import io
import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from PIL import Image

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class Shape:
    """One primitive of one node, in world space.

    Attributes:
        attributes: by the file's names; unit normals. (n, 2 to 4) each.
        faces: (m, 3). material: index in the file; None for the default.
    """

    attributes: dict[str, F32]
    faces: NDArray[np.uint32]
    material: int | None


@dataclass(frozen=True)
class File:
    """Contents of a file.

    Attributes:
        lights: lights of KHR_lights_punctual, with their transform (4, 4).
    """

    json: dict[str, Any]
    folder: Path
    shapes: list[Shape] = field(default_factory=list)
    lights: list[tuple[dict[str, Any], F64]] = field(default_factory=list)
    chunk: bytes = b""

    def buffer_view(self, number: int) -> bytes:
        """Bytes of a buffer view."""
        view = self.json["bufferViews"][number]
        buffer = self.json["buffers"][view["buffer"]]
        data = self._bytes(buffer["uri"]) if "uri" in buffer else self.chunk
        start = view.get("byteOffset", 0)
        return data[start : start + view["byteLength"]]

    def accessor(self, number: int) -> NDArray[Any]:
        """Values of an accessor, normalized integers as fractions. (count, width)"""
        description = self.json["accessors"][number]
        dtype, width, count = (
            np.dtype(_TYPES[description["componentType"]]),
            _WIDTHS[description["type"]],
            description["count"],
        )
        view = self.json["bufferViews"][description["bufferView"]]
        data, start = self.buffer_view(description["bufferView"]), description.get("byteOffset", 0)
        stride = view.get("byteStride", dtype.itemsize * width)
        rows = np.lib.stride_tricks.as_strided(
            np.frombuffer(data, np.uint8)[start:], (count, dtype.itemsize * width), (stride, 1), writeable=False
        )
        values = np.ascontiguousarray(rows).view(dtype)
        return values / np.float32(np.iinfo(dtype).max) if description.get("normalized") else values

    def image(self, texture: int) -> NDArray[np.uint8]:
        """Bytes of a texture, RGBA. (height, width, 4)"""
        texture_info = self.json["textures"][texture]
        source = (
            texture_info.get("extensions", {})
            .get("EXT_texture_webp", texture_info)
            .get("source", texture_info.get("source"))
        )
        image = self.json["images"][source]
        data = self.buffer_view(image["bufferView"]) if "bufferView" in image else self._bytes(image["uri"])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))

    def wraps(self, texture: int) -> str:
        """Wrap mode of a texture, in Mitsuba's terms."""
        sampler = self.json["textures"][texture].get("sampler")
        mode = 10_497 if sampler is None else self.json["samplers"][sampler].get("wrapS", 10_497)
        return {33_071: "clamp", 33_648: "mirror"}.get(mode, "repeat")

    def _bytes(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.folder / unquote(uri)).read_bytes()


def read_plain(path: Path) -> File:
    """Read a file that is known to be valid."""
    data, chunk = path.read_bytes(), b""
    if data[:4] == b"glTF":
        length = struct.unpack_from("<I", data, 12)[0]
        chunk, data = data[28 + length :], data[20 : 20 + length]
    file = File(json.loads(data), path.parent, chunk=chunk)
    lights = file.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    for node, to_world in _walk_nodes(file.json):
        number = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
        if number is not None:
            file.lights.append((lights[number], to_world))
        if "mesh" in node:
            primitives = file.json["meshes"][node["mesh"]]["primitives"]
            file.shapes.extend(
                _shape(file, primitive, to_world) for primitive in primitives if primitive.get("mode", 4) in _TRIANGLES
            )
    return file


def _walk_nodes(document: dict[str, Any]) -> Iterator[tuple[dict[str, Any], F64]]:
    stack = [(root, np.eye(4)) for root in document["scenes"][document.get("scene", 0)]["nodes"]]
    while stack:
        number, parent = stack.pop()
        node = document["nodes"][number]
        to_world = parent @ _local(node)
        yield node, to_world
        stack.extend((child, to_world) for child in node.get("children", []))


def _local(node: dict[str, Any]) -> F64:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    q = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    local = np.eye(4)
    local[:3, :3] = (np.eye(3) + 2 * w * q + 2 * q @ q) * np.array(node.get("scale", [1, 1, 1]))
    local[:3, 3] = node.get("translation", [0, 0, 0])
    return local


def _shape(file: File, primitive: dict[str, Any], to_world: F64) -> Shape:
    attributes = {name: file.accessor(k).astype(np.float32) for name, k in primitive["attributes"].items()}
    positions, linear = attributes["POSITION"], to_world[:3, :3]
    faces = file.accessor(primitive["indices"]) if "indices" in primitive else np.arange(len(positions))
    triangles = _TRIANGLES[primitive.get("mode", 4)](np.asarray(faces, np.uint32).reshape(-1))
    mirrored = np.linalg.det(linear) < 0
    attributes["POSITION"] = (positions @ linear.T + to_world[:3, 3]).astype(np.float32)
    triangles = triangles[:, ::-1] if mirrored else triangles
    if "NORMAL" in attributes:
        attributes["NORMAL"] = _complete_normals(attributes["NORMAL"] @ np.linalg.inv(linear), attributes, triangles)
    else:
        attributes, triangles = _make_flat(attributes, triangles)
    if "TANGENT" in attributes:
        along, handedness = (
            unit(attributes["TANGENT"][:, :3] @ linear.T),
            attributes["TANGENT"][:, 3:] * (-1 if mirrored else 1),
        )
        attributes["TANGENT"] = np.concatenate([along, handedness], axis=1).astype(np.float32)
    return Shape(attributes, np.ascontiguousarray(triangles), primitive.get("material"))


def _complete_normals(normals: NDArray[Any], attributes: dict[str, F32], faces: NDArray[np.uint32]) -> F32:
    """Unit normals; those without length, which the format forbids, are means of the triangles' around."""
    corners = attributes["POSITION"][faces]
    around = np.zeros_like(normals)
    for corner in range(3):
        np.add.at(around, faces[:, corner], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    has_length = np.linalg.norm(normals, axis=1, keepdims=True) > 1e-6
    return unit(np.where(has_length, normals, around))


def _strip(corners: NDArray[np.uint32]) -> NDArray[np.uint32]:
    triangles = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    triangles[1::2, :2] = triangles[1::2, 1::-1]
    return triangles


# triangles of a primitive's corners by its mode: a list, a strip, a fan
_TRIANGLES: dict[int, Callable[[NDArray[np.uint32]], NDArray[np.uint32]]] = {
    4: lambda corners: corners[: len(corners) // 3 * 3].reshape(-1, 3),
    5: _strip,
    6: lambda corners: np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1),
}


def _make_flat(attributes: dict[str, F32], faces: NDArray[np.uint32]) -> tuple[dict[str, F32], NDArray[np.uint32]]:
    """Give each triangle its own vertices and normal."""
    corners = faces.reshape(-1)
    corner_attributes = {name: values[corners] for name, values in attributes.items()}
    a, b, c = corner_attributes["POSITION"].reshape(-1, 3, 3).transpose(1, 0, 2)
    corner_attributes["NORMAL"] = np.repeat(unit(np.cross(b - a, c - a)), 3, axis=0)
    return corner_attributes, np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)


def linear(display: F32) -> F32:
    """Decode sRGB."""
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4).astype(np.float32)


def unit(vectors: NDArray[Any]) -> F32:
    """Normalize vectors, except those without length. (n, 3)"""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1), np.float32)
