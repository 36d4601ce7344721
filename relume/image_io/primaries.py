"""Light in other primaries than ours: OpenEXR's `chromaticities`, Radiance's `PRIMARIES`, converted to linear Rec. 709.

With the columns of P the primaries (x, y, 1 − x − y), and s so that they add up to the white, P s = w / y_w, colours go
to XYZ by P diag(s), from the file's white to ours by von Kries's rule in Bradford's cone space (ICC.1, annex E), and
from XYZ by the inverse for Rec. 709. So the file's white stays white.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]

Chromaticities = tuple[float, float, float, float, float, float, float, float]
"""x and y of red, green, blue and white, in the order of both formats."""

REC_709: Chromaticities = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""ITU-R BT.709-6."""

INTEROP_SPACES: Mapping[str, Chromaticities] = {
    "lin_rec709_scene": REC_709,
    "lin_ap0_scene": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),  # ACES2065-1
    "lin_ap1_scene": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767),  # ACEScg
    "lin_rec2020_scene": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "lin_p3d65_scene": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290),
    "lin_adobergb_scene": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290),
}
"""Linear spaces in use, by the ids that files name them by (ASWF Color Interop Forum)."""

_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_MAX_COORDINATE = 2.0  # of a coordinate from 0; primaries that enclose all colours are within 1.1
_MIN_WHITE = 0.1  # y of a white
_MIN_AREA = 0.01  # of the primaries' triangle, twice; Rec. 709 has 0.22
_MAX_GAIN = 10.0  # of a channel in the result; of the widest primaries in use it is 2.5
_TOLERANCE = 2e-3  # files round, and some write D65 with three digits
_MATRIX_TOLERANCE = 5e-4  # of a matrix: AP1 and Rec. 2020, the most alike of those in use, differ by sixty times that
_MIN_SUM = 1e-6  # X + Y + Z of a primary
_STRIP_ROWS = 256


def to_rec_709(chromaticities: Sequence[float]) -> F64 | None:
    """The matrix that converts colours of these primaries; None where they are ours.

    Args:
        chromaticities: x and y of red, green, blue and white. 8 numbers
    Returns:
        Multiplies a column of red, green and blue. (3, 3) float64
    Raises:
        ValueError: no colours can be told by such primaries.
    """
    values = np.array(chromaticities, np.float64)
    if values.shape != (8,) or not np.isfinite(values).all() or np.abs(values).max() > _MAX_COORDINATE:
        raise ValueError("its chromaticities are no colours")
    if np.abs(values - REC_709).max() <= _TOLERANCE:
        return None
    rec_709_to_xyz = _to_xyz(np.array(REC_709))
    source_to_xyz = _to_xyz(values)
    source_cones, rec_709_cones = _BRADFORD @ source_to_xyz.sum(axis=1), _BRADFORD @ rec_709_to_xyz.sum(axis=1)
    if source_cones.min() <= 0:
        raise ValueError("its white is no colour")
    adapted = np.linalg.solve(_BRADFORD, (rec_709_cones / source_cones)[:, None] * _BRADFORD)
    matrix = np.linalg.solve(rec_709_to_xyz, adapted @ source_to_xyz)
    if not np.abs(matrix).max() <= _MAX_GAIN:
        raise ValueError("its primaries lie too close together")
    return np.asarray(matrix)


def interop_id(matrix: F64) -> str | None:
    """The id of a linear space that is in use. matrix: what its red, green and blue are in Rec. 709. (3, 3), columns"""
    for name, chromaticities in INTEROP_SPACES.items():
        candidate = to_rec_709(chromaticities)
        if np.abs(matrix - (np.eye(3) if candidate is None else candidate)).max() <= _MATRIX_TOLERANCE:
            return name
    return None


def chromaticities_from_matrix(matrix: F64) -> Chromaticities:
    """Primaries and white by which a file's reader finds the matrix: those that it has where the white is ours.

    Args:
        matrix: what red, green and blue are in Rec. 709. (3, 3), columns
    Raises:
        ValueError: no primaries do that.
    """
    primaries_xyz = _to_xyz(np.array(REC_709)) @ matrix
    corners = np.column_stack([primaries_xyz, primaries_xyz.sum(axis=1)])
    sums = corners.sum(axis=0)
    if np.abs(sums).min() < _MIN_SUM:
        raise ValueError("one of its primaries is no colour")
    values = (corners[:2] / sums).T.ravel()
    round_trip = to_rec_709(values)
    if not np.allclose(np.eye(3) if round_trip is None else round_trip, matrix, atol=_TOLERANCE):
        raise ValueError("its white is not ours")
    return tuple(map(float, values))  # type: ignore[return-value]


def convert(pixels: F32, matrix: F64) -> None:
    """Convert colours in place, some rows at a time: a map of 16k is 1.6 GB.

    Args:
        pixels: texels that are not finite may become so in all channels. (height, width, 3)
        matrix: as `to_rec_709` makes it. (3, 3)
    """
    small = matrix.T.astype(np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        for first in range(0, len(pixels), _STRIP_ROWS):
            rows = slice(first, first + _STRIP_ROWS)
            pixels[rows] = pixels[rows] @ small


def _to_xyz(values: F64) -> F64:
    """From red, green and blue to XYZ, where white has Y = 1. values: (8,). Returns: (3, 3)"""
    x, y = values.reshape(4, 2).T
    corners = np.stack([x, y, 1 - x - y])
    primaries, white = corners[:, :3], corners[:, 3]
    if abs(np.linalg.det(primaries)) < _MIN_AREA or white[1] < _MIN_WHITE:
        raise ValueError("its primaries lie on a line, or its white is black")
    scales = np.linalg.solve(primaries, white / white[1])
    if scales.min() <= 0:
        raise ValueError("its white is not among its primaries")
    return np.asarray(primaries * scales)
