"""STL, binary and text: triangles, and the colors that VisCAM, SolidView and Materialise Magics add to binary files.

3D Systems' StereoLithography Interface Specification, 1989. A binary file is known by its length or by its normals, not
by its first word: many begin with "solid".
"""

from __future__ import annotations

import re
from array import array
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import srgb_decode
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, unsupported
from relume.scene.validate import MAX_TRIANGLES
from relume.scene_io.obj_ply.text import Faults, counted, decode_text, number, plain_lines

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
HEADER_BYTES = 84
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
NUM_PROBED = 100
MAX_SOLIDS = 10_000
TEXT_TOKEN = re.compile(
    rb"^[ \t]*(?:vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)|(endfacet)|solid\b(.*)|(endsolid).*)", re.M | re.I
)
TEXT_FACET = re.compile(rb"^\s*facet\b", re.MULTILINE | re.IGNORECASE)
HAS_COLOR = 1 << 15


@dataclass(frozen=True)
class Stl:
    """The triangles of an STL file.

    Attributes:
        positions: separate for each corner in the file; equal ones are merged.
        triangles: indices of positions.
        colors: linear, of triangles, or None.
        solids: name and number of triangles of each solid, in order.
    """

    positions: Shaped[F64, "positions 3"]
    triangles: Shaped[I64, "triangles 3"]
    colors: Shaped[F32, "triangles 3"] | None
    solids: tuple[tuple[str, int], ...]


def is_stl(data: bytes) -> bool:
    """True if a file has the length of a binary STL or begins like one, or is one in text."""
    return _is_binary(data) or (data[:256].lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid")


def _is_binary(data: bytes) -> bool:
    """True for the length that the header says; otherwise, if all of the first normals have length 1 or 0."""
    if len(data) < HEADER_BYTES:
        return False
    num_triangles = int.from_bytes(data[80:84], "little")
    if HEADER_BYTES + FACET.itemsize * num_triangles == len(data):
        return True
    if TEXT_FACET.search(data[:4_096]):
        return False
    count = min(num_triangles, NUM_PROBED, (len(data) - HEADER_BYTES) // FACET.itemsize)
    facets = np.frombuffer(data, FACET, count, HEADER_BYTES)
    if count == 0 or not (np.isfinite(facets["normal"]).all() and np.isfinite(facets["corners"]).all()):
        return False
    length = np.linalg.norm(facets["normal"].astype(np.float64), axis=1)
    return bool(((np.abs(length - 1) < 0.01) | (length == 0)).all() and facets["corners"].any())


def read_stl(data: bytes, warnings: list[ImporterWarning]) -> Stl:
    """Read the triangles of a file.

    Args:
        data: the file. warnings: gets a sentence for each part that is missing.
    Raises:
        SceneError: it has too many triangles.
    """
    return _read_binary(data, warnings) if _is_binary(data) else _read_text(data, warnings)


def _read_binary(data: bytes, warnings: list[ImporterWarning]) -> Stl:
    num_triangles = int.from_bytes(data[80:84], "little")
    num_read = min(num_triangles, (len(data) - HEADER_BYTES) // FACET.itemsize)
    if num_read < num_triangles:
        warnings.append(unsupported(f"The .stl file ends early: it has {num_read:,} of {num_triangles:,} triangles."))
    if num_read > MAX_TRIANGLES:
        raise SceneError(f"the .stl file has more than {MAX_TRIANGLES:,} triangles; simplify it")
    facets = np.frombuffer(data, FACET, num_read, HEADER_BYTES)
    corners = facets["corners"].astype(np.float64)
    is_usable = np.isfinite(corners).all(axis=(1, 2))
    if not is_usable.all():
        num = int((~is_usable).sum())
        warnings.append(unsupported(f"Left out {counted(num, 'face')} of the .stl file: vertices are not numbers."))
    colors = facet_colors(data[:80], facets["attribute"])
    return _merge_corners(
        corners[is_usable], None if colors is None else colors[is_usable], (("", int(is_usable.sum())),)
    )


def facet_colors(
    header: bytes, attributes: Shaped[NDArray[np.uint16], " triangles"]
) -> Shaped[F32, "triangles 3"] | None:
    """Linear colors of triangles, or None if the file has none.

    With "COLOR=" and RGBA in the header, as Magics writes it, the attribute is red, green, blue from bit 0, and bit 15
    means the color of the header. Otherwise, as VisCAM and SolidView write it, it is blue, green, red from bit 0, and
    bit 15 means that there is one; other triangles are gray.

    Args:
        header: the first 80 bytes. attributes: the last two bytes of each triangle.
    """
    channels = (attributes[:, None] >> np.array([0, 5, 10], np.uint16) & 31) / 31.0
    own = (attributes & HAS_COLOR) != 0
    mark = header.find(b"COLOR=")
    if mark >= 0 and mark + 10 <= len(header):
        default = np.frombuffer(header, np.uint8, 3, mark + 6) / 255.0
        encoded = np.where(own[:, None], default, channels)
    elif own.any():
        encoded = np.where(own[:, None], channels[:, ::-1], 0.8)
    else:
        return None
    return srgb_decode(encoded.astype(np.float32))


def _read_text(data: bytes, warnings: list[ImporterWarning]) -> Stl:
    values = array("d")
    names, counts = [""], [0]
    faults, num_corners, is_open = Faults(), 0, False
    for token in TEXT_TOKEN.finditer(plain_lines(data)):
        if token[1] is not None:
            num_corners += 1
            values.extend(_corner(token))
        elif token[4] is not None and token[4].lower() == b"endfacet":
            complete = num_corners == 3
            if not complete:
                del values[len(values) - 3 * num_corners :]
                faults.add(f"triangle {sum(counts) + 1:,}", f"{num_corners} vertices")
            counts[-1] += complete
            num_corners = 0
            if len(values) > 9 * MAX_TRIANGLES:
                raise SceneError(f"the .stl file has more than {MAX_TRIANGLES:,} triangles; simplify it")
        elif token[5] is not None:
            is_open = True
            if counts[-1] and len(names) < MAX_SOLIDS:
                names.append("")
                counts.append(0)
            names[-1] = names[-1] or decode_text(token[5]).strip()[:200]
        elif token[6] is not None:
            is_open = False
    if num_corners or is_open:
        warnings.append(unsupported("The .stl file ends early: it has no endsolid."))
        del values[len(values) - 3 * num_corners :]
    warnings.extend(faults.warnings(f"Left out {counted(faults.count, 'incomplete triangle')} of the .stl file:"))
    corners = np.array(values, np.float64).reshape(-1, 3, 3)
    owner = np.repeat(np.arange(len(names)), counts)
    is_usable = np.isfinite(corners).all(axis=(1, 2))
    if not is_usable.all():
        num = int((~is_usable).sum())
        warnings.append(unsupported(f"Left out {counted(num, 'face')} of the .stl file: vertices are not numbers."))
    num_usable = np.bincount(owner[is_usable], minlength=len(names)).tolist()
    named = tuple(zip(names, num_usable, strict=True))
    return _merge_corners(corners[is_usable], None, named)


def _corner(token: re.Match[bytes]) -> tuple[float, float, float]:
    """Position of a vertex; NaN if it has words instead of numbers."""
    try:
        return number(token[1]), number(token[2]), number(token[3])
    except ValueError:
        return np.nan, np.nan, np.nan


def _merge_corners(corners: F64, colors: F32 | None, solids: tuple[tuple[str, int], ...]) -> Stl:
    """Merge equal positions, for normals that are averaged over the triangles at a vertex."""
    positions, indices = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)  # -0 is 0
    return Stl(positions, indices.reshape(-1, 3).astype(np.int64), colors, solids)
