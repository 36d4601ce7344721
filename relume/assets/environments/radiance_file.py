"""Radiance .hdr files (Ward 1994, Graphics Gems II.5; filefmts.pdf of Radiance), of all writers.

A header of text ends with the resolution, such as `-Y height +X width`; pixels follow with or without run lengths.
OpenImageIO decodes the usual dialect, to which other ones are converted here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote
from relume.image_io.open_image import check_claim
from relume.image_io.orientation import TRANSPOSED
from relume.image_io.primaries import CIE_XYZ, declared_primaries, to_rec_709

F64 = NDArray[np.float64]

_MAX_HEADER_BYTES = 1 << 20
_RESOLUTION = re.compile(
    rb"^[ \t]*([-+])([XY])[ \t]+(\d{1,9})[ \t]+([-+])([XY])[ \t]+(\d{1,9})[ \t]*\r?\n", re.M | re.I
)
_ORIENTATIONS = {
    b"-Y+X": 1, b"-Y-X": 2, b"+Y-X": 3, b"+Y+X": 4, b"+X-Y": 5, b"-X-Y": 6, b"-X+Y": 7, b"+X+Y": 8
}  # fmt: skip
_USUAL_HEADER = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n"
_RGBE, _XYZE = b"32-bit_rle_rgbe", b"32-bit_rle_xyze"
_MAX_EXPOSURE = 1e12


class RadianceFile(NamedTuple):
    """A file that OpenImageIO decodes, and its interpretation.

    Attributes:
        data: the converted file; its first row is the first one of the original.
        orientation: of the stored rows, as `relume.image_io.orientation.orient` takes it.
        to_rec_709: matrix that converts stored colors to radiance; None if they are.
        warnings: predicates, without a subject.
    """

    data: bytes
    orientation: int
    to_rec_709: Shaped[F64, " 3 3"] | None
    warnings: tuple[ImporterWarning, ...]


def is_radiance(data: bytes) -> bool:
    """True for files that begin as Radiance files do; the oldest have no identifier."""
    return data.startswith(b"#?") or b"FORMAT=32-bit_rle_" in data[:1_024]


def read_radiance_file(data: bytes, label: str, check_size: Callable[[int, int], object]) -> RadianceFile:
    """Read the header, and convert the file to the usual dialect.

    Args:
        data: contents of the file. label: name in messages.
        check_size: raises SceneError if width and height are not allowed.
    Raises:
        SceneError: there is no header, it has an unknown pixel format, or it claims too many pixels.
    """
    match = _RESOLUTION.search(data[:_MAX_HEADER_BYTES])
    orientation = _ORIENTATIONS.get(match[1] + match[2].upper() + match[4] + match[5].upper()) if match else None
    if match is None or orientation is None:
        raise SceneError(f"{label} has no Radiance header with a resolution; export it again")
    fields = _read_fields(data[: match.start()])
    pixel_format = fields.get(b"FORMAT", [_RGBE])[-1]
    if pixel_format not in (_RGBE, _XYZE):
        shown = quote(pixel_format.decode("latin-1"))
        raise SceneError(f"{label} has the pixel format {shown}; save it as {_RGBE.decode()}")
    rows, columns = int(match[3]), int(match[6])
    check_size(*((rows, columns) if orientation in TRANSPOSED else (columns, rows)))
    check_claim(rows * columns * 12, data, label)
    pixels = data[match.end() :]
    if not _has_run_lengths(pixels, columns):
        pixels = _expand_old_run_lengths(pixels, rows * columns)
    matrix, warnings = _conversion_matrix(fields, is_xyz=pixel_format == _XYZE)
    return RadianceFile(_USUAL_HEADER % (rows, columns) + pixels, orientation, matrix, warnings)


def _read_fields(header: bytes) -> dict[bytes, list[bytes]]:
    """Values of each variable, in the order of the file."""
    fields: dict[bytes, list[bytes]] = {}
    for line in header.splitlines():
        variable, equals, value = line.partition(b"=")
        if equals and not line.startswith(b"#"):
            fields.setdefault(variable.strip(), []).append(value.strip())
    return fields


def _conversion_matrix(
    fields: dict[bytes, list[bytes]], is_xyz: bool
) -> tuple[F64 | None, tuple[ImporterWarning, ...]]:
    """Conversion of primaries after the division by EXPOSURE and COLORCORR, of which several multiply."""
    matrix, warnings = declared_primaries(_numbers(fields.get(b"PRIMARIES", [b""])[-1]))
    if is_xyz:  # Radiance's white has equal energy
        matrix, warnings = to_rec_709(CIE_XYZ), []
    exposure = np.ones(3)
    for value in fields.get(b"EXPOSURE", []) + fields.get(b"COLORCORR", []):
        numbers = _numbers(value)
        exposure = exposure * (numbers if len(numbers) in (1, 3) else math.nan)
    if not all(1 / _MAX_EXPOSURE <= factor <= _MAX_EXPOSURE for factor in exposure):
        return matrix, (*warnings, approximated("has an invalid exposure, which was not used."))
    if (exposure == 1).all():
        return matrix, tuple(warnings)
    shown = " ".join(f"{factor:g}" for factor in (exposure[:1] if np.ptp(exposure) == 0 else exposure))
    warning = approximated(f"was divided by its exposure, {shown}, as the format defines; some programs do not.")
    return (np.eye(3) if matrix is None else matrix) / exposure, (*warnings, warning)


def _numbers(words: bytes) -> list[float]:
    """Numbers of a header line; NaN for words that are none."""
    try:
        return [float(word) for word in words.split()]
    except ValueError:
        return [math.nan]


def _has_run_lengths(pixels: bytes, width: int) -> bool:
    """True if the first row is encoded by channels, as Radiance does since 1991."""
    return 8 <= width < 1 << 15 and pixels[:4] == bytes((2, 2, width >> 8, width & 255))


def _expand_old_run_lengths(pixels: bytes, num_pixels: int) -> bytes:
    """Expand runs of the oldest files: (1, 1, 1, n) repeats the pixel before it n times, further ones 256 n times …"""
    codes = np.frombuffer(pixels[: len(pixels) // 4 * 4], np.uint8).reshape(-1, 4)
    is_run = (codes[:, :3] == 1).all(axis=1)
    if not is_run[1:].any():
        return pixels
    is_run[0] = False
    index = np.arange(len(codes), dtype=np.int32)
    literal = np.maximum.accumulate(np.where(is_run, 0, index))
    shift = 8 * np.minimum(index - literal - 1, 2)
    counts = np.where(is_run, codes[:, 3].astype(np.int64) << np.maximum(shift, 0), 1)
    ends = np.minimum(np.cumsum(counts), num_pixels)
    return np.repeat(codes[literal], np.diff(ends, prepend=0), axis=0).tobytes()
