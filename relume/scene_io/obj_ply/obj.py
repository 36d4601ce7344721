"""Reader of Wavefront OBJ: keeps the lines that describe polygons, in file order.

Object Files, appendix B1 of Wavefront's Advanced Visualizer manual. Curves, surfaces, points and lines are ignored.
Negative indices count back from the current line. A line that cannot be read is left out; of vertices, normals and UV
coordinates it counts as NaN, so that the indices of others stay right.
"""

from __future__ import annotations

import io
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.obj_ply.polygons import OUT_OF_RANGE, Polygons
from relume.scene_io.obj_ply.text import (
    Faults,
    before_comment,
    counted,
    decode_text,
    number,
    plain_lines,
    strip_comment,
)

MAX_LINE_BYTES = 1 << 20
MAX_GROUPS = 10_000
MAX_INDEX = 2**40
BYTE_COLORS = 2.0  # vertex colors above are numbers up to 255, not in [0, 1]
COLORED_TOKENS = (7, 8)  # tokens of a vertex with a color, or with a color and alpha
IGNORED_KEYWORDS = {b"p": "points", b"l": "lines", b"curv": "curves", b"curv2": "curves", b"surf": "surfaces"}
WIDTHS = {b"v": 3, b"vn": 3, b"vt": 2}


@dataclass
class Obj:
    """The polygons of an OBJ file and its references.

    Attributes:
        colors: vertex colors after the coordinates of `v` lines; NaN for vertices without one.
        libraries: names of material files, as written: one or several to a line.
        groups: index of each pair of object and material.
        corners: indices of position, UV and normal. lengths, group: corners and group of each polygon.
        ignored_keywords: kinds of unsupported lines.
        faults: lines that cannot be read.
    """

    positions: array[float] = field(default_factory=lambda: array("d"))
    uvs: array[float] = field(default_factory=lambda: array("d"))
    normals: array[float] = field(default_factory=lambda: array("d"))
    colors: array[float] = field(default_factory=lambda: array("d"))
    libraries: list[str] = field(default_factory=list)
    groups: dict[tuple[str, str], int] = field(default_factory=dict)
    corners: array[int] = field(default_factory=lambda: array("q"))
    lengths: array[int] = field(default_factory=lambda: array("q"))
    group: array[int] = field(default_factory=lambda: array("q"))
    ignored_keywords: set[bytes] = field(default_factory=set)
    faults: Faults = field(default_factory=Faults)

    def polygons(self) -> Polygons:
        """The polygons of all groups."""
        return Polygons(np.array(self.corners, np.int64).reshape(-1, 3), np.array(self.lengths, np.int64))

    def vertex_colors(self, warnings: list[ImporterWarning]) -> Shaped[NDArray[np.float32], "positions 3"] | None:
        """Linear colors of all positions, or None; vertices without one are white."""
        colors = as_rows(self.colors, 3)
        if len(colors) == 0:
            return None
        colors = np.pad(colors, ((0, len(self.positions) // 3 - len(colors)), (0, 0)), constant_values=np.nan)
        is_missing = np.asarray(~np.isfinite(colors).all(axis=1))
        if is_missing.any():
            message = f"Vertices of the .obj file without a color are white: {int(is_missing.sum()):,}."
            warnings.append(approximated(message))
        colors[is_missing] = np.nan
        if np.nanmax(colors, initial=0.0) > BYTE_COLORS:
            warnings.append(approximated("The vertex colors were read as numbers from 0 to 255: some are above 1."))
            colors = colors / 255
        return srgb_decode(np.clip(np.where(is_missing[:, None], 1, colors), 0, 1).astype(np.float32))

    def warnings(self) -> list[ImporterWarning]:
        """Warnings about lines that were left out."""
        kinds = sorted({IGNORED_KEYWORDS[keyword] for keyword in self.ignored_keywords})
        return [
            *self.faults.warnings(
                f"Left out {counted(self.faults.count, 'line')} of the .obj file that cannot be read:"
            ),
            *(ignored(f"The file's {kind} aren't supported; only faces are shown.") for kind in kinds),
        ]


def read_obj(data: bytes) -> Obj:
    """Read the lines of a file.

    Raises:
        SceneError: a line is too long, or there are too many triangles or objects.
    """
    obj = Obj()
    object_name, material = "", ""
    num_triangles = 0
    for line_number, line in enumerate(_lines(data), 1):
        tokens = line.split()
        if not tokens:
            continue
        kind = tokens[0]
        if b"#" in line and (kind == b"f" or kind in WIDTHS):
            tokens = before_comment(tokens)
        try:
            if kind in WIDTHS:
                _add_vector(obj, kind, tokens)
            elif kind == b"f":
                num_triangles += _add_face(obj, (object_name, material), tokens[1:])
            elif kind == b"usemtl":
                material = _text(line, kind)
            elif kind == b"o":
                object_name = _text(line, kind)
            elif kind == b"mtllib":
                obj.libraries.append(_text(line, kind))
            elif kind in IGNORED_KEYWORDS:
                obj.ignored_keywords.add(kind)
        except SceneError:
            raise
        except (ValueError, OverflowError):
            obj.faults.add(f"line {line_number:,}", line[:80].decode("ascii", "replace"))
            if kind in WIDTHS:
                _values(obj, kind).extend([np.nan] * WIDTHS[kind])
        if num_triangles > MAX_TRIANGLES:
            raise SceneError(f"the .obj file has more than {MAX_TRIANGLES:,} triangles; simplify it")
    return obj


def _lines(data: bytes) -> io.BytesIO:
    lines = plain_lines(data)
    if max(map(len, io.BytesIO(lines)), default=0) > MAX_LINE_BYTES:
        raise SceneError(f"a line of the .obj file is longer than {MAX_LINE_BYTES:,} bytes; export it again")
    return io.BytesIO(lines)


def _values(obj: Obj, kind: bytes) -> array[float]:
    return obj.positions if kind == b"v" else obj.normals if kind == b"vn" else obj.uvs


def _add_vector(obj: Obj, kind: bytes, tokens: Sequence[bytes]) -> None:
    """Append a vertex, a normal or UV coordinates, whose second is zero if it is missing."""
    width = WIDTHS[kind]
    vector = tokens[1 : 1 + width]
    if len(vector) < width:
        if kind != b"vt" or not vector:
            raise ValueError("too few numbers")
        vector = [*vector, b"0"]
    try:
        values = list(map(float, vector))
    except ValueError:
        values = list(map(number, vector))
    if kind == b"v" and len(tokens) in COLORED_TOKENS:
        color = list(map(number, tokens[4:7]))
        obj.colors.extend([np.nan] * (len(obj.positions) - len(obj.colors)))
        obj.colors.extend(color)
    _values(obj, kind).extend(values)


def _add_face(obj: Obj, key: tuple[str, str], tokens: Sequence[bytes]) -> int:
    """Append a polygon; return the number of its triangles."""
    counts = (len(obj.positions) // 3, len(obj.uvs) // 2, len(obj.normals) // 3)
    corners = [index for token in tokens for index in _corner(token, counts)]
    if len(tokens) < 3:
        raise ValueError("a face has fewer than three corners")
    group = obj.groups.setdefault(key, len(obj.groups))
    if group >= MAX_GROUPS:
        raise SceneError(f"the .obj file has more than {MAX_GROUPS:,} objects; merge them")
    obj.corners.extend(corners)
    obj.lengths.append(len(tokens))
    obj.group.append(group)
    return len(tokens) - 2


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
    """Zero-based index; those of the future are valid, those of before the first are not."""
    index = int(text)
    if index == 0 or index < -count or index > MAX_INDEX:
        return OUT_OF_RANGE
    return index - 1 if index > 0 else count + index


def _text(line: bytes, kind: bytes) -> str:
    return strip_comment(decode_text(line.strip()[len(kind) :]))[:1_000]


def as_rows(values: array[float], width: int) -> NDArray[np.float64]:
    """An array of rows. (len(values) // width, width)"""
    return np.array(values, np.float64).reshape(-1, width)
