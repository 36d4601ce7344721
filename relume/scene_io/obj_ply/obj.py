"""Reader of Wavefront OBJ: keeps the lines that describe triangles, in file order.

Object Files, appendix B1 of Wavefront's Advanced Visualizer manual. Polygons become fans; curves, surfaces, points and
lines are ignored. Negative indices count back from the current line.
"""

from __future__ import annotations

import io
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode
from relume.core.errors import SceneError
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.obj_ply.weld import Corners

MAX_LINE_BYTES = 1 << 20
MAX_GROUPS = 10_000
_NUM_COLORED_TOKENS = 7  # tokens of a vertex with a color
IGNORED_KEYWORDS = {b"p", b"l", b"curv", b"curv2", b"surf"}


@dataclass
class Obj:
    """The triangles of an OBJ file and its references.

    Attributes:
        colors: vertex colors after the coordinates of `v` lines; ignored unless every vertex has one.
        libraries: names of material files.
        groups: triangles, nine indices each, by object and material.
        ignored_keywords: kinds of unsupported lines.
    """

    positions: array[float] = field(default_factory=lambda: array("d"))
    uvs: array[float] = field(default_factory=lambda: array("d"))
    normals: array[float] = field(default_factory=lambda: array("d"))
    colors: array[float] = field(default_factory=lambda: array("d"))
    libraries: list[str] = field(default_factory=list)
    groups: dict[tuple[str, str], array[int]] = field(default_factory=dict)
    ignored_keywords: set[str] = field(default_factory=set)

    def vertex_colors(self) -> Shaped[NDArray[np.float32], "positions 3"] | None:
        """Linear colors of all positions, or None."""
        colors = _rows(self.colors, 3)
        if len(colors) == 0 or len(self.colors) != len(self.positions) or not np.isfinite(colors).all():
            return None
        return srgb_decode(np.clip(colors, 0, 1).astype(np.float32))

    def corners(self) -> dict[tuple[str, str], Corners]:
        """The triangles of each group, with v from the top."""
        positions, uvs, normals = _rows(self.positions, 3), _rows(self.uvs, 2), _rows(self.normals, 3)
        uvs[:, 1] = 1 - uvs[:, 1]
        return {
            key: Corners(positions, uvs, normals, np.frombuffer(group, np.int64).reshape(-1, 3, 3))
            for key, group in self.groups.items()
        }


def read_obj(data: bytes) -> Obj:
    """Read the lines of a file.

    Raises:
        SceneError: a line is invalid, or there are too many triangles or objects.
    """
    obj = Obj()
    object_name, material = "", ""
    num_triangles = 0
    for number, line in enumerate(_lines(data), 1):
        tokens = line.split()
        if not tokens:
            continue
        kind = tokens[0]
        try:
            if kind == b"v":
                obj.positions.extend([float(tokens[1]), float(tokens[2]), float(tokens[3])])
                if len(tokens) == _NUM_COLORED_TOKENS:
                    obj.colors.extend([float(tokens[4]), float(tokens[5]), float(tokens[6])])
            elif kind == b"vn":
                obj.normals.extend([float(tokens[1]), float(tokens[2]), float(tokens[3])])
            elif kind == b"vt":
                obj.uvs.extend([float(tokens[1]), float(tokens[2]) if len(tokens) > 2 else 0.0])
            elif kind == b"f":
                num_triangles += _add_face(obj, _group(obj, object_name, material), tokens[1:])
            elif kind == b"usemtl":
                material = _text(line, kind)
            elif kind == b"o":
                object_name = _text(line, kind)
            elif kind == b"mtllib":
                obj.libraries.append(_text(line, kind))
            elif kind in IGNORED_KEYWORDS:
                obj.ignored_keywords.add(kind.decode())
        except SceneError:
            raise
        except (ValueError, IndexError, OverflowError):
            printable = line[:40].decode("ascii", "replace").strip()
            raise SceneError(
                f"line {number:,} of the .obj file cannot be read ({printable!r}); export it again"
            ) from None
        if num_triangles > MAX_TRIANGLES:
            raise SceneError(f"the .obj file has more than {MAX_TRIANGLES:,} triangles; simplify it")
    return obj


def _lines(data: bytes) -> io.BytesIO | list[bytes]:
    """Lines, with continuations after a backslash joined."""
    if max(map(len, io.BytesIO(data)), default=0) > MAX_LINE_BYTES:
        raise SceneError(f"a line of the .obj file is longer than {MAX_LINE_BYTES:,} bytes; export it again")
    return io.BytesIO(data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ") if b"\\" in data else data)


def _group(obj: Obj, object_name: str, material: str) -> array[int]:
    group = obj.groups.get((object_name, material))
    if group is None:
        if len(obj.groups) >= MAX_GROUPS:
            raise SceneError(f"the .obj file has more than {MAX_GROUPS:,} objects; merge them")
        group = obj.groups[object_name, material] = array("q")
    return group


def _add_face(obj: Obj, group: array[int], tokens: Sequence[bytes]) -> int:
    """Append a polygon as a fan; return the number of its triangles."""
    counts = (len(obj.positions) // 3, len(obj.uvs) // 2, len(obj.normals) // 3)
    corners = [_corner(token, counts) for token in tokens]
    if len(corners) < 3:
        raise ValueError("a face has fewer than three corners")
    hub = corners[0]
    for second, third in pairwise(corners[1:]):
        group.extend((*hub, *second, *third))
    return len(corners) - 2


def _corner(token: bytes, counts: tuple[int, int, int]) -> tuple[int, int, int]:
    """Zero-based position, UV and normal of `v/vt/vn`; -1 if missing."""
    index_texts = token.split(b"/")
    if len(index_texts) > 3 or not index_texts[0]:
        raise ValueError("a corner is not v, v/vt, v//vn or v/vt/vn")
    index_texts += [b""] * (3 - len(index_texts))
    v, vt, vn = (
        _index(index_text, count) if index_text else -1 for index_text, count in zip(index_texts, counts, strict=True)
    )
    return v, vt, vn


def _index(text: bytes, count: int) -> int:
    index = int(text)
    if index == 0 or index < -count or index > 2**40:
        raise ValueError("numbers start at one")
    return index - 1 if index > 0 else count + index


def _text(line: bytes, kind: bytes) -> str:
    return line.strip()[len(kind) :].decode("utf-8", "replace").strip()[:1_000]


def _rows(values: array[float], width: int) -> NDArray[np.float64]:
    return np.array(values, np.float64).reshape(-1, width)
