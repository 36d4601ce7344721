"""Small glTF files built by code, valid or broken on purpose."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import PIL.Image

DIELECTRIC_TRANSMISSION = 0.956463  # 1 minus the mean reflectance of a dielectric of index 1.5
FLOAT, U8, U16, U32 = 5126, 5121, 5123, 5125
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
COMPONENTS = {"f4": FLOAT, "u1": U8, "u2": U16, "u4": U32, "i1": 5120, "i2": 5122}

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
QUAD_FACES = np.array([0, 1, 2, 0, 2, 3], np.uint16)
QUAD_UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
QUAD_NORMALS = np.repeat(np.array([[0, 0, 1]], np.float32), 4, axis=0)


class Glb:
    """A document under construction: add arrays and images, change `document` as you like, then take `bytes()`."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "buffers": []}
        self.binary = bytearray()

    def view(self, data: bytes) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.document["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data
        return len(self.document["bufferViews"]) - 1

    def accessor(self, values: Any, **more: Any) -> int:
        values = np.asarray(values)
        width = values.shape[1] if values.ndim == 2 else 1
        self.document["accessors"].append(
            {
                "bufferView": self.view(values.tobytes()),
                "componentType": COMPONENTS[values.dtype.str[1:]],
                "count": len(values),
                "type": TYPES[width],
                **more,
            }
        )
        return len(self.document["accessors"]) - 1

    def texture(self, pixels: Any, sampler: dict[str, int] | None = None, kind: str = "PNG") -> int:
        encoded = io.BytesIO()
        options = {"lossless": True} if kind == "WEBP" else {}
        PIL.Image.fromarray(np.asarray(pixels, np.uint8)).save(encoded, kind, **options)
        images, textures = self.document.setdefault("images", []), self.document.setdefault("textures", [])
        images.append({"bufferView": self.view(encoded.getvalue()), "mimeType": f"image/{kind.lower()}"})
        textures.append({"source": len(images) - 1})
        if sampler is not None:
            self.document.setdefault("samplers", []).append(sampler)
            textures[-1]["sampler"] = len(self.document["samplers"]) - 1
        return len(textures) - 1

    def quad(self, material: dict[str, Any] | None = None, **attributes: Any) -> Glb:
        """A unit square in the plane z = 0, facing +Z, with a node that refers to it."""
        names = {"POSITION": QUAD, "NORMAL": QUAD_NORMALS, "TEXCOORD_0": QUAD_UVS, **attributes}
        primitive: dict[str, Any] = {
            "attributes": {name: self.accessor(values) for name, values in names.items() if values is not None},
            "indices": self.accessor(QUAD_FACES),
        }
        if material is not None:
            self.document["materials"] = [material]
            primitive["material"] = 0
        self.document["meshes"] = [{"name": "quad", "primitives": [primitive]}]
        self.document["nodes"] = [{"mesh": 0}]
        self.document["scenes"] = [{"nodes": [0]}]
        return self

    def bytes(self) -> bytes:
        if not self.document["buffers"]:
            self.document["buffers"] = [{"byteLength": len(self.binary)}]
        return pack(self.document, bytes(self.binary))


def pack(document: dict[str, Any], binary: bytes) -> bytes:
    """A .glb file of a document and its first buffer."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def self_contained(path: Path) -> bytes:
    """A .gltf file with its external files as data URIs; unchanged where that is not possible."""
    data = path.read_bytes()
    try:
        document = json.loads(data)
        resources = [*document.get("buffers", []), *document.get("images", [])]
        for resource in resources:
            uri = resource.get("uri", "data:")
            resource_path = path.parent / unquote(uri)
            if not uri.startswith("data:") and ".." not in uri and resource_path.is_file():
                resource["uri"] = (
                    "data:application/octet-stream;base64," + base64.b64encode(resource_path.read_bytes()).decode()
                )
        return json.dumps(document).encode()
    except (ValueError, AttributeError, TypeError, OSError):
        return data
