"""Headers of Radiance .hdr files: lines of text, an empty line, then `-Y height +X width`."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.image_io.primaries import to_rec_709

F64 = NDArray[np.float64]

_MAX_LINE_BYTES, _MAX_HEADER_BYTES = 2_048, 65_536
_RESOLUTION = re.compile(rb"-Y\s+(\d{1,9})\s+\+X\s+(\d{1,9})\s*\Z")
_PRIMARIES = b"PRIMARIES="


class RadianceHeader(NamedTuple):
    """The fields of a header that are used.

    Attributes:
        width, height: in pixels.
        to_rec_709: matrix that converts its colors; None for Rec. 709 or without primaries.
        has_odd_primaries: its primaries are invalid.
    """

    width: int
    height: int
    to_rec_709: Shaped[F64, " 3 3"] | None
    has_odd_primaries: bool


def read_header(data: bytes, name: str) -> RadianceHeader:
    """Read a header.

    Args:
        data: contents of the file. name: name of the environment, in messages.
    Raises:
        SceneError: there is no header, or rows are not ordered from the top.
    """
    lines = data[:_MAX_HEADER_BYTES].split(b"\n")
    try:
        end = lines.index(b"")
        resolution = lines[end + 1]
    except (ValueError, IndexError):
        raise SceneError(f"environment {name!r} has no Radiance header; export it again") from None
    match = _RESOLUTION.match(resolution)
    if match is None or max(len(line) for line in lines[:end]) > _MAX_LINE_BYTES:
        raise SceneError(f"environment {name!r} has an unsupported Radiance header; save it with the top row first")
    primaries = [line.removeprefix(_PRIMARIES).split() for line in lines[:end] if line.startswith(_PRIMARIES)]
    matrix, is_odd = _conversion_matrix(primaries[-1]) if primaries else (None, False)
    return RadianceHeader(int(match[2]), int(match[1]), matrix, is_odd)


def _conversion_matrix(primaries: list[bytes]) -> tuple[F64 | None, bool]:
    """Matrix that converts colors, and True for invalid primaries: many programs write invalid ones for Rec. 709."""
    try:
        values = [float(number) for number in primaries]
        return (to_rec_709(values), False) if any(values) else (None, False)  # zeros mean unknown
    except ValueError:
        return None, True
