"""Headers of Radiance's .hdr: lines of text, an empty one, then `-Y height +X width`."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.errors import SceneError
from relume.imageio.primaries import to_rec_709

F64 = NDArray[np.float64]

_LONGEST_LINE, _LONGEST = 2_048, 65_536
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
    lines = data[:_LONGEST].split(b"\n")
    try:
        end = lines.index(b"")
        resolution = lines[end + 1]
    except (ValueError, IndexError):
        raise SceneError(f"environment {name!r} has no Radiance header; export it again") from None
    found = _RESOLUTION.match(resolution)
    if found is None or max(len(line) for line in lines[:end]) > _LONGEST_LINE:
        raise SceneError(f"environment {name!r} has an odd Radiance header; save it top row first")
    told = [line.removeprefix(_PRIMARIES).split() for line in lines[:end] if line.startswith(_PRIMARIES)]
    matrix, is_odd = _matrix_of(told[-1]) if told else (None, False)
    return RadianceHeader(int(found[2]), int(found[1]), matrix, is_odd)


def _matrix_of(told: list[bytes]) -> tuple[F64 | None, bool]:
    """What converts colours, and whether nothing can be told: many programs write nonsense, and mean Rec. 709."""
    try:
        values = [float(number) for number in told]
        return (to_rec_709(values), False) if any(values) else (None, False)  # zeros: not known
    except ValueError:
        return None, True
