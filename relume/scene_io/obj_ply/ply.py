"""Stanford PLY, text and binary: vertices, faces and triangle strips, with colors and UV coordinates of either.

The format of Turk 1994 (The PLY Polygon File Format), with what other programs add: images in `comment TextureFile`,
UV coordinates of corners in `texcoord`, their image in `texnumber`, and the strips of `tristrips`. Counts are checked
against the available bytes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, unsupported
from relume.scene_io.obj_ply.ply_rows import (
    BinaryRows,
    Columns,
    Element,
    Lists,
    Property,
    TextRows,
    count_rows,
    read_body,
    whole_numbers,
)
from relume.scene_io.obj_ply.polygons import Polygons
from relume.scene_io.obj_ply.text import counted, decode_text

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
MAX_HEADER_BYTES = 64 << 10
MAX_PROPERTIES = 200
MAX_TEXTURES = 100
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
TYPES |= {"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float32": "f4", "float64": "f8"}
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
LARGEST = {"u1": 255, "i1": 127, "u2": 65_535, "i2": 32_767, "u4": 2**32 - 1, "i4": 2**31 - 1}
BYTE_COLORS = 2.0  # colors in floating point above are numbers up to 255, not in [0, 1]
END_OF_HEADER = re.compile(rb"(\r\n|\n|\r)end_header[ \t]*(?:\r\n|\n|\r)")
TEXTURE = re.compile(r"(?:comment|obj_info)\s+TextureFile\s+(.+)", re.IGNORECASE)


@dataclass(frozen=True)
class Ply:
    """The polygons of a PLY file.

    Attributes:
        uvs: v from the top, of vertices or of corners.
        colors: linear, of vertices, or None. face_colors: linear, of polygons, or None.
        textures: names of images. texture_index: of each polygon; empty if the file has none.
    """

    positions: Shaped[F64, "positions 3"]
    uvs: Shaped[F64, "uvs 2"]
    normals: Shaped[F64, "normals 3"]
    polygons: Polygons
    colors: Shaped[F32, "positions 3"] | None
    face_colors: Shaped[F32, "polygons 3"] | None
    textures: tuple[str, ...]
    texture_index: Shaped[I64, " textured_polygons"]


def read_ply(data: bytes, warnings: list[ImporterWarning]) -> Ply:
    """Read the polygons of a file.

    Args:
        data: the file. warnings: gets a sentence for each part that is not read, or read otherwise.
    Raises:
        SceneError: the header is invalid, or the file has no vertices or no faces.
    """
    order, elements, start, textures = read_header(data)
    body = memoryview(data)[start:]
    read = read_body(BinaryRows(body, order) if order else TextRows(body), elements, ("vertex", "face", "tristrips"))
    vertex, face = read.get("vertex", {}), read.get("face", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise SceneError("the .ply file has no vertices with x, y and z; export it again")
    faces = face.get("vertex_indices", face.get("vertex_index"))
    strips = next((column for column in read.get("tristrips", {}).values() if isinstance(column, tuple)), None)
    if not isinstance(faces, tuple) and strips is None:
        raise SceneError("the .ply file has no faces; make a mesh of the points and export it again")
    _warn_truncated(elements, read, warnings)
    lengths, vertices = faces if isinstance(faces, tuple) else (np.zeros(0, np.int64), np.zeros(0))
    face = face if isinstance(faces, tuple) else {}  # without corners, its columns belong to no polygon
    vertices = whole_numbers(vertices)
    strip_vertices = np.zeros((0, 3), np.int64) if strips is None else unroll_strips(strips)
    positions, normals = _columns(vertex, ("x", "y", "z")), _columns(vertex, ("nx", "ny", "nz"))
    uvs, uv_indices = _uvs(vertex, face.get("texcoord"), lengths, vertices, warnings)
    indices = np.concatenate([vertices, strip_vertices.reshape(-1)])
    uv_indices = np.concatenate(
        [uv_indices, strip_vertices.reshape(-1) if _has_uvs(vertex) else np.full(strip_vertices.size, -1)]
    )
    normal_indices = indices if len(normals) else np.full_like(indices, -1)
    corners = np.stack([indices, uv_indices, normal_indices], axis=-1)
    polygons = Polygons(corners, np.concatenate([lengths, np.full(len(strip_vertices), 3)]))
    face_colors = _colors(face, elements, "face", warnings)
    if face_colors is not None and len(strip_vertices):
        face_colors = np.concatenate([face_colors, np.ones((len(strip_vertices), 3), np.float32)])
    number = face.get("texnumber")
    texture_index = np.zeros(0, np.int64) if number is None or isinstance(number, tuple) else whole_numbers(number)
    texture_index = np.pad(texture_index, (0, len(strip_vertices) if len(texture_index) else 0))
    colors = _colors(vertex, elements, "vertex", warnings)
    return Ply(positions, uvs * [1, -1] + [0, 1], normals, polygons, colors, face_colors, textures, texture_index)


def read_header(data: bytes) -> tuple[str, list[Element], int, tuple[str, ...]]:
    """Read the byte order ("" for text), the elements, the offset of the rows, and the images. Raises SceneError."""
    end = END_OF_HEADER.search(data[:MAX_HEADER_BYTES])
    if end is None:
        raise SceneError("the .ply file has no end_header; export it again")
    lines = re.split(r"\r\n|\n|\r", decode_text(data[: end.start()]))
    order: str | None = None
    elements: list[tuple[str, int, list[Property]]] = []
    textures: list[str] = []
    for line in lines[1:]:
        tokens = line.split()
        try:
            if tokens[:1] == ["format"]:
                order = FORMATS[tokens[1]]
            elif tokens[:1] == ["element"]:
                elements.append((tokens[1], _count(tokens[2]), []))
            elif tokens[:1] == ["property"]:
                elements[-1][2].append(_property(tokens[1:]))
            elif (texture := TEXTURE.match(line.strip())) and len(textures) < MAX_TEXTURES:
                textures.append(texture[1].strip().strip('"')[:1_000])
        except (KeyError, IndexError, ValueError):
            raise SceneError(f"the .ply header has an invalid line ({line[:40]!r}); export it again") from None
    if any(len(properties) > MAX_PROPERTIES for _, _, properties in elements):
        raise SceneError(f"an element of the .ply file has more than {MAX_PROPERTIES} properties; remove some")
    if order is None:
        raise SceneError("the .ply header has no format; export it again")
    parsed = [Element(name, rows, tuple(properties)) for name, rows, properties in elements]
    return order, parsed, end.end(), tuple(textures)


def _count(token: str) -> int:
    if not re.fullmatch(r"\d{1,12}", token):
        raise ValueError(token)
    return int(token)


def _property(tokens: list[str]) -> Property:
    if tokens[0] == "list":
        return Property(tokens[3], TYPES[tokens[2]], TYPES[tokens[1]])
    return Property(tokens[1], TYPES[tokens[0]])


def _warn_truncated(elements: list[Element], read: dict[str, Columns], warnings: list[ImporterWarning]) -> None:
    for element in elements:
        if element.name in ("vertex", "face", "tristrips") and element.properties:
            num_rows = count_rows(read[element.name])
            if num_rows < element.rows:
                message = f"The .ply file ends early: it has {num_rows:,} of {element.rows:,} rows of {element.name}."
                warnings.append(unsupported(message))


def _columns(rows: Columns, names: tuple[str, ...]) -> F64:
    """Columns of an element; no rows if one is missing. (rows, len(names))"""
    columns = [rows[name] for name in names if name in rows]
    if len(columns) < len(names) or any(isinstance(column, tuple) for column in columns):
        return np.zeros((0, len(names)))
    return np.stack([np.asarray(column, np.float64) for column in columns], axis=-1)


def _has_uvs(vertex: Columns) -> bool:
    return any(len(_columns(vertex, names)) for names in UVS)


def _uvs(
    vertex: Columns, texcoord: object, lengths: I64, vertices: I64, warnings: list[ImporterWarning]
) -> tuple[F64, I64]:
    """UV coordinates, v from the bottom, and their index at each corner of the faces, -1 for none."""
    if not isinstance(texcoord, tuple):
        uvs = next((candidate for names in UVS if len(candidate := _columns(vertex, names))), np.zeros((0, 2)))
        return uvs, vertices if len(uvs) else np.full_like(vertices, -1)
    num_values, values = texcoord
    has_uvs = num_values == 2 * lengths
    if (num_wrong := int((~has_uvs & (num_values > 0)).sum())) > 0:
        message = f"Left out UV coordinates of {counted(num_wrong, 'face')} of the .ply file: not two for each corner."
        warnings.append(unsupported(message))
    owner = np.repeat(np.arange(len(lengths)), lengths)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    start = np.cumsum(num_values) - num_values
    index = np.where(has_uvs[owner], start[owner] + 2 * step, -1)
    corner_uvs = np.asarray(values, np.float64)
    used = index >= 0
    uvs = np.stack([corner_uvs[index[used]], corner_uvs[index[used] + 1]], axis=-1)
    return uvs, np.where(used, np.cumsum(used) - 1, -1)


def unroll_strips(strips: Lists) -> Shaped[I64, "triangles 3"]:
    """Triangles of strips; -1 begins a new one, as does the end of a list. Every second is turned."""
    lengths, values = strips
    vertices = whole_numbers(values)
    is_last = np.zeros(len(vertices) + 1, np.bool_)
    is_last[np.cumsum(lengths)] = True  # a strip does not go beyond its list
    start = np.zeros(len(vertices), np.int64)
    index = np.arange(len(vertices))
    is_break = vertices == -1
    start = np.where(is_last[:-1] | np.r_[False, is_break[:-1]][: len(vertices)], index, 0)
    position = index - np.maximum.accumulate(start) if len(vertices) else index
    third = np.flatnonzero(position >= 2)
    third = third[~(is_break[third] | is_break[third - 1] | is_break[third - 2])]
    odd = position[third] % 2
    return np.stack([vertices[third - 2 + odd], vertices[third - 1 - odd], vertices[third]], axis=-1)


def _colors(rows: Columns, elements: list[Element], name: str, warnings: list[ImporterWarning]) -> F32 | None:
    """Linear colors of an element from sRGB: integers of any size, or numbers in [0, 1] or up to 255. (rows, 3)"""
    names = next((names for names in COLORS if len(_columns(rows, names))), None)
    if names is None:
        return None
    colors = _columns(rows, names)
    is_missing = ~np.isfinite(colors).all(axis=1)
    if is_missing.any():
        message = f"Made {counted(int(is_missing.sum()), 'color')} of the .ply file white: not numbers."
        warnings.append(unsupported(message))
        colors[is_missing] = np.inf
    types = {p.name: p.type for element in elements if element.name == name for p in element.properties}
    largest = float(LARGEST.get(types[names[0]], 1))
    if largest == 1 and colors[~is_missing].max(initial=0) > BYTE_COLORS:
        warnings.append(
            approximated("The colors of the .ply file were read as numbers from 0 to 255: some are above 1.")
        )
        largest = 255
    alpha = rows.get("alpha")
    if isinstance(alpha, np.ndarray) and len(alpha) and float(alpha.min()) < LARGEST.get(types["alpha"], 1):
        warnings.append(unsupported("The opacity of the vertex colors of the .ply file was ignored."))
    return srgb_decode(np.clip(colors / largest, 0, 1).astype(np.float32))
