"""Light in other primaries than ours: OpenEXR's `chromaticities`, Radiance's `PRIMARIES`, converted to linear Rec. 709.

With the columns of P the primaries (x, y, 1 − x − y), and s so that they add up to the white, P s = w / y_w, colours go
to XYZ by P diag(s), from the file's white to ours by von Kries's rule in Bradford's cone space (ICC.1, annex E), and
from XYZ by the inverse for Rec. 709. So the file's white stays white.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]

REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x and y of red, green, blue and white (ITU-R BT.709-6), in the order of both formats."""

_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_FURTHEST = 2.0  # of a coordinate from 0; primaries that enclose all colours are within 1.1
_LEAST_WHITE = 0.1  # y of a white
_LEAST_AREA = 0.01  # of the primaries' triangle, twice; Rec. 709 has 0.22
_MOST_GAIN = 10.0  # of a channel in the result; of the widest primaries in use it is 2.5
_SAME = 2e-3  # files round, and some write D65 with three digits
_ROWS_AT_ONCE = 256


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
    if values.shape != (8,) or not np.isfinite(values).all() or np.abs(values).max() > _FURTHEST:
        raise ValueError("its chromaticities are no colours")
    if np.abs(values - REC_709).max() <= _SAME:
        return None
    ours = _to_xyz(np.array(REC_709))
    theirs = _to_xyz(values)
    cones, own_cones = _BRADFORD @ theirs.sum(axis=1), _BRADFORD @ ours.sum(axis=1)
    if cones.min() <= 0:
        raise ValueError("its white is no colour")
    adapted = np.linalg.solve(_BRADFORD, (own_cones / cones)[:, None] * _BRADFORD)
    matrix = np.linalg.solve(ours, adapted @ theirs)
    if not np.abs(matrix).max() <= _MOST_GAIN:
        raise ValueError("its primaries lie too close together")
    return np.asarray(matrix)


def convert(pixels: F32, matrix: F64) -> None:
    """Convert colours in place, some rows at a time: a map of 16k is 1.6 GB.

    Args:
        pixels: texels that are not finite may become so in all channels. (height, width, 3)
        matrix: as `to_rec_709` makes it. (3, 3)
    """
    small = matrix.T.astype(np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        for first in range(0, len(pixels), _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            pixels[rows] = pixels[rows] @ small


def _to_xyz(values: F64) -> F64:
    """From red, green and blue to XYZ, where white has Y = 1. values: (8,). Returns: (3, 3)"""
    x, y = values.reshape(4, 2).T
    corners = np.stack([x, y, 1 - x - y])
    primaries, white = corners[:, :3], corners[:, 3]
    if abs(np.linalg.det(primaries)) < _LEAST_AREA or white[1] < _LEAST_WHITE:
        raise ValueError("its primaries lie on a line, or its white is black")
    shares = np.linalg.solve(primaries, white / white[1])
    if shares.min() <= 0:
        raise ValueError("its white is not among its primaries")
    return np.asarray(primaries * shares)
