"""Headers of Radiance's .hdr: lines of text, an empty one, then `-Y height +X width`."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.image_io.primaries import to_rec_709

F64 = NDArray[np.float64]

_MAX_LINE_BYTES, _MAX_HEADER_BYTES = 2_048, 65_536
_RESOLUTION = re.compile(rb"-Y\s+(\d{1,9})\s+\+X\s+(\d{1,9})\s*\Z")
_PRIMARIES = b"PRIMARIES="


class RadianceHeader(NamedTuple):
    """What counts of it.

    Attributes:
        width, height: in pixels.
        to_rec_709: what converts its colours, the matrix (3, 3); None where they are ours, or it does not tell.
        has_odd_primaries: whether it tells primaries that are none.
    """

    width: int
    height: int
    to_rec_709: F64 | None
    has_odd_primaries: bool


def read_header(data: bytes, name: str) -> RadianceHeader:
    """Read a header.

    Args:
        data: of the file. name: what people call it.
    Raises:
        SceneError: there is none, or rows are in another order than from the top.
    """
    lines = data[:_MAX_HEADER_BYTES].split(b"\n")
    try:
        end = lines.index(b"")
        resolution = lines[end + 1]
    except (ValueError, IndexError):
        raise SceneError(f"environment {name!r} has no Radiance header; export it again") from None
    match = _RESOLUTION.match(resolution)
    if match is None or max(len(line) for line in lines[:end]) > _MAX_LINE_BYTES:
        raise SceneError(f"environment {name!r} has an odd Radiance header; save it top row first")
    primaries = [line.removeprefix(_PRIMARIES).split() for line in lines[:end] if line.startswith(_PRIMARIES)]
    matrix, is_odd = _conversion_matrix(primaries[-1]) if primaries else (None, False)
    return RadianceHeader(int(match[2]), int(match[1]), matrix, is_odd)


def _conversion_matrix(primaries: list[bytes]) -> tuple[F64 | None, bool]:
    """What converts colours, and whether nothing can be told: many programs write nonsense, and mean Rec. 709."""
    try:
        values = [float(number) for number in primaries]
        return (to_rec_709(values), False) if any(values) else (None, False)  # zeros: not known
    except ValueError:
        return None, True
