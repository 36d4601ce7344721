"""A scene small enough to write by hand, for the smoke test: a sphere on a floor under a sky with a sun."""

from __future__ import annotations

import json
import struct

import numpy as np
from numpy.typing import NDArray

FLOAT, UINT = 5126, 5125


def glb() -> bytes:
    """A binary glTF of a gold-like "Ball" on a white "Floor", with one camera "front"."""
    parts = [_floor(), _sphere()]
    blob = b""
    views: list[dict[str, object]] = []
    accessors: list[dict[str, object]] = []
    meshes: list[dict[str, object]] = []
    for material, (positions, normals, faces) in enumerate(parts):
        first = len(accessors)
        for array, component, kind in ((positions, FLOAT, "VEC3"), (normals, FLOAT, "VEC3"), (faces, UINT, "SCALAR")):
            data = array.tobytes()
            views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
            accessor: dict[str, object] = {
                "bufferView": len(views) - 1,
                "componentType": component,
                "count": len(array),
                "type": kind,
            }
            if array is positions:
                accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
            accessors.append(accessor)
            blob += data
        attributes = {"POSITION": first, "NORMAL": first + 1}
        meshes.append({"primitives": [{"attributes": attributes, "indices": first + 2, "material": material}]})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0}, {"mesh": 1}, {"camera": 0, "name": "front", "translation": [0.0, 1.0, 4.0]}],
        "cameras": [{"type": "perspective", "name": "front", "perspective": {"yfov": 0.7, "znear": 0.01}}],
        "materials": [_material("Floor", [0.8, 0.8, 0.8], 0.0, 0.9), _material("Ball", [1.0, 0.7, 0.3], 1.0, 0.3)],
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def hdr(width: int = 64, height: int = 32) -> bytes:
    """A Radiance picture (flat RGBE scanlines): a sky that fades to the ground and one bright sun."""
    radiance = np.empty((height, width, 3))
    radiance[:] = np.linspace(1.0, 0.1, height)[:, None, None] * np.array([0.6, 0.8, 1.0])
    radiance[6:9, 10:13] = 60.0
    exponent = np.ceil(np.log2(radiance.max(axis=2)))
    mantissa = np.floor(radiance / np.exp2(exponent)[..., None] * 255.0)
    pixels = np.concatenate([mantissa, exponent[..., None] + 128.0], axis=2).astype(np.uint8)
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + pixels.tobytes()


Triangles = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint32]]


def _floor() -> Triangles:
    positions = np.array([[-3, 0, -3], [-3, 0, 3], [3, 0, 3], [3, 0, -3]], np.float32)
    normals = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    return positions, normals, np.array([0, 1, 2, 0, 2, 3], np.uint32)


def _sphere(num_rows: int = 24, num_columns: int = 48) -> Triangles:
    theta, phi = np.meshgrid(
        np.linspace(0.0, np.pi, num_rows + 1), np.linspace(0.0, 2.0 * np.pi, num_columns + 1), indexing="ij"
    )
    normals = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1)
    row, column = np.meshgrid(np.arange(num_rows), np.arange(num_columns), indexing="ij")
    a = row * (num_columns + 1) + column
    b = a + num_columns + 1
    upper = np.stack([a, b, b + 1], -1)[:-1]  # the last row's and, below, the first row's have no area at the pole
    lower = np.stack([a, b + 1, a + 1], -1)[1:]
    faces = np.concatenate([upper.reshape(-1), lower.reshape(-1)])
    flat = normals.reshape(-1, 3).astype(np.float32)
    return flat * np.float32(0.8) + np.array([0, 0.8, 0], np.float32), flat, faces.astype(np.uint32)


def _material(name: str, color: list[float], metallic: float, roughness: float) -> dict[str, object]:
    factors = {"baseColorFactor": [*color, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    return {"name": name, "pbrMetallicRoughness": factors}
