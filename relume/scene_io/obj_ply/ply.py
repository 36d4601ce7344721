"""Stanford PLY, text and binary: vertices with normals, UV coordinates and colors, and faces as fans.

The format of Turk 1994 (The PLY Polygon File Format). Counts are checked against the available bytes.
"""

from __future__ import annotations

import re

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode
from relume.core.errors import SceneError
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.obj_ply.ply_rows import BinaryRows, Columns, Element, Property, TextRows, read_body
from relume.scene_io.obj_ply.weld import Corners

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
MAX_HEADER_BYTES = 64 << 10
MAX_PROPERTIES = 200
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
TYPES |= {"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float32": "f4", "float64": "f8"}
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
COLORS = ("red", "green", "blue")


def read_ply(data: bytes) -> tuple[Corners, Shaped[F32, "positions 3"] | None]:
    """Read the triangles of a file, and the linear colors of its vertices if there are any.

    Raises:
        SceneError: the header is invalid, the file is truncated, or it has no faces.
    """
    order, elements, start = read_header(data)
    body = memoryview(data)[start:]
    read = read_body(BinaryRows(body, order) if order else TextRows(body), elements)
    vertex, face = read.get("vertex"), read.get("face", {})
    lists = face.get("vertex_indices", face.get("vertex_index"))
    if vertex is None or not {"x", "y", "z"} <= vertex.keys():
        raise SceneError("the .ply file has no vertices with x, y and z; export it again")
    if not isinstance(lists, tuple):
        raise SceneError("the .ply file has no faces; make a mesh of the points and export it again")
    indices = _fans(*lists)
    positions = _columns(vertex, ("x", "y", "z"))
    normals = _columns(vertex, ("nx", "ny", "nz"))
    uvs = next((candidate for names in UVS if len(candidate := _columns(vertex, names))), np.zeros((0, 2)))
    uvs = uvs * [1, -1] + [0, 1]
    missing_indices = np.full_like(indices, -1)
    triangles = np.stack([indices if len(values) else missing_indices for values in (positions, uvs, normals)], axis=-1)
    return Corners(positions, uvs, normals, triangles), _colors(vertex, elements)


def read_header(data: bytes) -> tuple[str, list[Element], int]:
    """Read the byte order ("" for text), the elements, and the offset of the rows. Raises SceneError."""
    end = re.search(rb"\nend_header[ \t]*\r?\n", data[:MAX_HEADER_BYTES])
    if end is None:
        raise SceneError("the .ply file has no end_header; export it again")
    lines = data[: end.start()].decode("ascii", "replace").splitlines()
    order: str | None = None
    elements: list[tuple[str, int, list[Property]]] = []
    for line in lines[1:]:
        tokens = line.split()
        try:
            if tokens[:1] == ["format"]:
                order = FORMATS[tokens[1]]
            elif tokens[:1] == ["element"]:
                elements.append((tokens[1], _count(tokens[2]), []))
            elif tokens[:1] == ["property"]:
                elements[-1][2].append(_property(tokens[1:]))
        except (KeyError, IndexError, ValueError):
            raise SceneError(f"the .ply header has an invalid line ({line[:40]!r}); export it again") from None
    if any(len(properties) > MAX_PROPERTIES for _, _, properties in elements):
        raise SceneError(f"an element of the .ply file has more than {MAX_PROPERTIES} properties; remove some")
    if order is None:
        raise SceneError("the .ply header has no format; export it again")
    return order, [Element(name, rows, tuple(properties)) for name, rows, properties in elements], end.end()


def _count(token: str) -> int:
    if not re.fullmatch(r"\d{1,12}", token):
        raise ValueError(token)
    return int(token)


def _property(tokens: list[str]) -> Property:
    if tokens[0] == "list":
        if TYPES[tokens[1]].startswith("f"):
            raise ValueError("the length of a list is not an integer")
        return Property(tokens[3], TYPES[tokens[2]], TYPES[tokens[1]])
    return Property(tokens[1], TYPES[tokens[0]])


def _columns(vertex: Columns, names: tuple[str, ...]) -> F64:
    """Columns of the vertices; no rows if one is missing. (rows, len(names))"""
    columns = [vertex[name] for name in names if name in vertex]
    if len(columns) < len(names) or any(isinstance(column, tuple) for column in columns):
        return np.zeros((0, len(names)))
    return np.stack([np.asarray(column, np.float64) for column in columns], axis=-1)


def _fans(lengths: NDArray[np.int64], values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (n, 3) of concatenated polygons; those with fewer than three corners are skipped."""
    num_triangles = np.maximum(lengths - 2, 0)
    if int(num_triangles.sum()) > MAX_TRIANGLES:
        raise SceneError(f"the .ply file has more than {MAX_TRIANGLES:,} triangles; simplify it")
    first = np.cumsum(lengths) - lengths
    hub = np.repeat(first, num_triangles)
    step = np.arange(len(hub)) - np.repeat(np.cumsum(num_triangles) - num_triangles, num_triangles)
    return np.asarray(values[np.stack([hub, hub + step + 1, hub + step + 2], axis=-1)])


def _colors(vertex: Columns, elements: list[Element]) -> F32 | None:
    """Linear vertex colors from sRGB bytes or numbers in [0, 1]. (rows, 3)"""
    colors = _columns(vertex, COLORS)
    if len(colors) == 0 or not np.isfinite(colors).all():
        return None
    types = {p.name: p.type for element in elements if element.name == "vertex" for p in element.properties}
    return srgb_decode(np.clip(colors / (1 if types["red"].startswith("f") else 255), 0, 1).astype(np.float32))
