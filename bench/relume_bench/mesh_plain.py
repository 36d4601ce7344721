"""Read .obj and .ply files as plain arrays for a peer: see `relume_bench.gltf_plain`, which reads glTF.

Materials become those of glTF, as docs/formats.md says they are read: gray plastic without a material, the PBR keywords
literally, a gray Ks as the gloss of plastic. Normals that the file lacks are means over faces within 60°.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume_bench.gltf_plain import File, Shape, linear, unit

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_CREASE = np.cos(np.radians(60.0))
_GRAY = {"pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": 0, "roughnessFactor": 0.5}}
_WHITE = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.5}}
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
_TYPES |= {"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_TYPES |= {"float32": "f4", "float64": "f8"}


def read_obj(path: Path) -> File:
    """Read an .obj file with its libraries; every material is one shape."""
    rows: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    corners: dict[str, list[tuple[int, int, int]]] = {}
    material, libraries = "", dict[str, dict[str, str]]()
    for line in path.read_text("utf-8", "replace").replace("\\\n", " ").splitlines():
        keyword, _, rest = line.strip().partition(" ")
        if keyword in rows:
            rows[keyword].append([float(number) for number in rest.split()])
        elif keyword == "usemtl":
            material = rest.strip()
        elif keyword == "mtllib" and (path.parent / rest.strip()).is_file():
            libraries |= _read_library(path.parent / rest.strip())
        elif keyword == "f":
            polygon = [_corner(text, rows) for text in rest.split()]
            for k in range(1, len(polygon) - 1):
                corners.setdefault(material, []).extend((polygon[0], polygon[k], polygon[k + 1]))
    file = File({"materials": [], "textures": [], "images": []}, path.parent)
    points = np.array([row[:3] for row in rows["v"]])
    has_colors = all(len(row) >= 6 for row in rows["v"]) and len(corners) == 1 and not libraries
    colors = linear(np.array([row[3:6] for row in rows["v"]], np.float32)) if has_colors else None
    uvs = np.array([row[:2] for row in rows["vt"]]).reshape(-1, 2) * [1, -1] + [0, 1]
    for name, indices in corners.items():
        triples = np.array(indices).reshape(-1, 3, 3)
        description = _WHITE if has_colors else _material(file, libraries[name]) if name in libraries else _GRAY
        file.json["materials"].append(description)
        normals = np.array(rows["vn"]).reshape(-1, 3)
        shape = _shape(points, uvs, normals, triples, colors, len(file.json["materials"]) - 1)
        file.shapes.append(shape)
    return file


def _corner(text: str, rows: dict[str, list[list[float]]]) -> tuple[int, int, int]:
    """Indices of position, UV and normal, from 0; -1 if missing."""
    numbers = [int(number) if number else 0 for number in [*text.split("/"), "", ""][:3]]
    counts = [len(rows[keyword]) for keyword in ("v", "vt", "vn")]
    a, b, c = (number + count if number < 0 else number - 1 for number, count in zip(numbers, counts, strict=True))
    return a, b, c


def _read_library(path: Path) -> dict[str, dict[str, str]]:
    """Text of each keyword of each material."""
    library: dict[str, dict[str, str]] = {}
    entries = dict[str, str]()
    for line in path.read_text("utf-8", "replace").splitlines():
        keyword, _, rest = line.strip().partition(" ")
        if keyword == "newmtl":
            entries = library[rest.strip()] = {}
        else:
            entries[keyword] = rest.strip()
    return library


def _material(file: File, entries: dict[str, str]) -> dict[str, Any]:
    """A material of glTF from the keywords of a library."""

    def color(keyword: str, default: float) -> F64:
        return np.broadcast_to([float(number) for number in entries.get(keyword, str(default)).split()[:3]], 3)

    base, gloss, emission = color("Kd", 0.0 if "map_Kd" in entries else 0.6), color("Ks", 0.0), color("Ke", 0.0)
    alpha = float(entries["d"]) if "d" in entries else 1 - float(entries.get("Tr", 0))
    pbr: dict[str, Any] = {"metallicFactor": float(entries.get("Pm", 0))}
    if "map_Kd" in entries:
        file.json["images"].append({"uri": entries["map_Kd"].split()[-1]})
        file.json["textures"].append({"source": len(file.json["images"]) - 1})
        pbr["baseColorTexture"] = {"index": len(file.json["textures"]) - 1}
        base = base if base.any() else np.ones(3)
    specular = 1.0
    if "Pr" in entries or "Pm" in entries:
        pbr["roughnessFactor"] = float(entries.get("Pr", 0.5))
    elif gloss.any() and np.ptp(gloss) > 0.05 * gloss.max():
        raise ValueError("a colored Ks is not a material of glTF")
    else:
        pbr["roughnessFactor"] = (2 / (float(entries.get("Ns", 0)) + 2)) ** 0.25
        specular = min(1.0, float(gloss.mean()) / 0.04)
    return {
        "pbrMetallicRoughness": {**pbr, "baseColorFactor": [*base.tolist(), alpha]},
        "emissiveFactor": emission.tolist(), "alphaMode": "BLEND" if alpha < 1 else "OPAQUE",
        "extensions": {"KHR_materials_specular": {"specularFactor": specular}},
    }  # fmt: skip


def read_ply(path: Path) -> File:
    """Read a .ply file, text or binary; vertex colors are in sRGB."""
    data = path.read_bytes()
    end = re.search(rb"end_header[ \t]*\r?\n", data)
    assert end is not None  # the importer has read it
    header = [line.split() for line in data[: end.start()].decode("ascii", "replace").splitlines()]
    order = next(_FORMATS[line[1]] for line in header if line and line[0] == "format")
    elements: dict[str, tuple[int, list[list[str]]]] = {}
    for line in header:
        if line and line[0] == "element":
            elements[line[1]] = (int(line[2]), [])
        elif line and line[0] == "property":
            list(elements.values())[-1][1].append(line[1:])
    rows = _binary_rows(data[end.end() :], elements, order) if order else _text_rows(data[end.end() :], elements)
    vertices, polygons = rows["vertex"], rows["face"]
    names = [kind[-1] for kind in elements["vertex"][1]]
    values = np.array(vertices, np.float64).reshape(len(vertices), -1)

    def columns(*wanted: str) -> F64:
        return values[:, [names.index(name) for name in wanted]] if set(wanted) <= set(names) else np.zeros((0, 3))

    list_index = next(k for k, kind in enumerate(elements["face"][1]) if kind[-1].startswith("vert"))
    lists = [row[list_index] for row in polygons]
    fans = [(p[0], p[k], p[k + 1]) for p in lists for k in range(1, len(p) - 1)]
    triangles, normals, colors = np.array(fans, np.int64), columns("nx", "ny", "nz"), None
    if "red" in names:
        is_byte = elements["vertex"][1][names.index("red")][0] in ("uchar", "uint8")
        colors = linear(np.asarray(columns("red", "green", "blue") / (255 if is_byte else 1), np.float32))
    missing = np.full_like(triangles, -1)
    triples = np.stack([triangles, missing, triangles if len(normals) else missing], axis=-1)
    file = File({"materials": [_GRAY if colors is None else _WHITE]}, path.parent)
    file.shapes.append(_shape(columns("x", "y", "z"), np.zeros((0, 2)), normals, triples, colors, 0))
    return file


def _text_rows(data: bytes, elements: dict[str, tuple[int, list[list[str]]]]) -> dict[str, list[list[Any]]]:
    words, rows = iter(data.split()), dict[str, list[list[Any]]]()
    for name, (count, kinds) in elements.items():
        rows[name] = [[_text_value(words, kind) for kind in kinds] for _ in range(count)]
    return rows


def _text_value(words: Iterator[bytes], kind: list[str]) -> Any:
    if kind[0] == "list":
        return [int(float(next(words))) for _ in range(int(next(words)))]
    return float(next(words))


def _binary_rows(
    data: bytes, elements: dict[str, tuple[int, list[list[str]]]], order: str
) -> dict[str, list[list[Any]]]:
    rows, start = dict[str, list[list[Any]]](), 0
    for name, (count, kinds) in elements.items():
        rows[name] = []
        for _ in range(count):
            row = list[Any]()
            for kind in kinds:
                number = 1
                if kind[0] == "list":
                    number, start = (
                        int(np.frombuffer(data, order + _TYPES[kind[1]], 1, start)[0]),
                        start + int(_TYPES[kind[1]][1]),
                    )
                dtype = np.dtype(order + _TYPES[kind[-2]])
                read = np.frombuffer(data, dtype, number, start).tolist()
                start += dtype.itemsize * number
                row.append(read if kind[0] == "list" else read[0])
            rows[name].append(row)
    return rows


def _shape(points: F64, uvs: F64, normals: F64, triples: I64, colors: F32 | None, material: int) -> Shape:
    """Give each corner its own vertex. triples: indices of position, UV and normal, (triangles, 3, 3)"""
    corner_points = points[triples[..., 0]]
    cross = np.cross(corner_points[:, 1] - corner_points[:, 0], corner_points[:, 2] - corner_points[:, 0])
    solid = np.linalg.norm(cross, axis=1) > 0
    triples, cross = triples[solid], cross[solid]
    flat = triples.reshape(-1, 3)
    corner_normals = _creased(cross, triples[..., 0])
    has_normal = flat[:, 2] >= 0
    corner_normals[has_normal] = unit(normals[flat[has_normal, 2]]) if has_normal.any() else 0
    attributes = {"POSITION": points[flat[:, 0]].astype(np.float32), "NORMAL": corner_normals.astype(np.float32)}
    if (flat[:, 1] >= 0).all() and len(uvs):
        attributes["TEXCOORD_0"] = uvs[flat[:, 1]].astype(np.float32)
    if colors is not None:
        attributes["COLOR_0"] = colors[flat[:, 0]]
    return Shape(attributes, np.arange(len(flat), dtype=np.uint32).reshape(-1, 3), material)


def _creased(cross: F64, vertices: I64) -> F64:
    """Normals of the corners: means of the faces at the same vertex within 60°, by area."""
    faces, normals = np.repeat(np.arange(len(cross)), 3), np.repeat(unit(cross), 3, axis=0).astype(np.float64)
    order = np.argsort(vertices.reshape(-1), kind="stable")
    total = np.zeros_like(normals)
    for around in np.split(order, np.flatnonzero(np.diff(vertices.reshape(-1)[order])) + 1):
        close = normals[around] @ normals[around].T > _CREASE
        np.fill_diagonal(close, True)
        total[around] = close @ cross[faces[around]]
    return unit(total).astype(np.float64)
