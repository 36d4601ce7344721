"""Conversion of other primaries to linear Rec. 709: OpenEXR's `chromaticities`, Radiance's `PRIMARIES`.

With the columns of P the primaries (x, y, 1 − x − y), and s such that they sum to the white, P s = w / y_w, colors are
converted to XYZ by P diag(s), from the file's white to D65 by von Kries adaptation in Bradford's cone space (ICC.1,
annex E), and from XYZ by the inverse for Rec. 709. So the file's white stays white.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]

Chromaticities = tuple[float, float, float, float, float, float, float, float]
"""x and y of red, green, blue and white, in the order of both formats."""

REC_709: Chromaticities = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""ITU-R BT.709-6."""

CIE_XYZ: Chromaticities = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
"""OpenEXR's way to say that channels are X, Y and Z."""

INTEROP_SPACES: Mapping[str, Chromaticities] = {
    "lin_rec709_scene": REC_709,
    "lin_ap0_scene": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),  # ACES2065-1
    "lin_ap1_scene": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767),  # ACEScg
    "lin_rec2020_scene": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "lin_p3d65_scene": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290),
    "lin_adobergb_scene": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290),
}
"""Common linear spaces, by their ids in files (ASWF Color Interop Forum)."""

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""CIE XYZ to the cone space of Bradford's adaptation (ICC.1, annex E)."""

_MAX_COORDINATE = 2.0  # maximum magnitude of a coordinate; primaries that enclose all colors are within 1.1
_MIN_WHITE = 0.1  # y of a white
_MIN_AREA = 0.01  # twice the area of the primaries' triangle; Rec. 709 has 0.22
_MAX_GAIN = 10.0  # of a channel in the result; 2.5 for the widest common primaries
_TOLERANCE = 2e-3  # files round, and some write D65 with three digits
_MATRIX_TOLERANCE = 5e-4  # of a matrix: AP1 and Rec. 2020, the most similar common spaces, differ by sixty times that
_MIN_SUM = 1e-6  # X + Y + Z of a primary
_STRIP_ROWS = 256


def to_rec_709(chromaticities: Sequence[float]) -> Shaped[F64, "3 3"] | None:
    """Matrix that converts columns of RGB with these primaries to linear Rec. 709; None if they are those of Rec. 709.

    Args:
        chromaticities: x and y of red, green, blue and white. 8 numbers
    Raises:
        ValueError: such primaries define no colors.
    """
    values = np.array(chromaticities, np.float64)
    if values.shape != (8,) or not np.isfinite(values).all() or np.abs(values).max() > _MAX_COORDINATE:
        raise ValueError("its chromaticities are not colors")
    if np.abs(values - REC_709).max() <= _TOLERANCE:
        return None
    rec_709_to_xyz = _to_xyz(np.array(REC_709))
    source_to_xyz = _to_xyz(values)
    source_cones, rec_709_cones = BRADFORD @ source_to_xyz.sum(axis=1), BRADFORD @ rec_709_to_xyz.sum(axis=1)
    if source_cones.min() <= 0:
        raise ValueError("its white is not a color")
    adapted = np.linalg.solve(BRADFORD, (rec_709_cones / source_cones)[:, None] * BRADFORD)
    matrix = np.linalg.solve(rec_709_to_xyz, adapted @ source_to_xyz)
    if not np.abs(matrix).max() <= _MAX_GAIN:
        raise ValueError("its primaries are too close together")
    return np.asarray(matrix)


def declared_primaries(values: Sequence[float]) -> tuple[Shaped[F64, "3 3"] | None, list[ImporterWarning]]:
    """Matrix that converts the colors of a file to linear Rec. 709.

    Args:
        values: chromaticities that the file declares; zeros mean unknown. Those of `CIE_XYZ` have no white to adapt to.
    Returns:
        The matrix; None if colors stay as they are. A warning about invalid chromaticities, as a predicate: many
        programs write invalid ones for Rec. 709.
    """
    try:
        if len(values) == len(CIE_XYZ) and np.allclose(values, CIE_XYZ, rtol=0, atol=_TOLERANCE):
            return np.asarray(np.linalg.inv(_to_xyz(np.array(REC_709)))), []
        return (to_rec_709(values) if any(values) else None), []
    except (TypeError, ValueError) as problem:
        return None, [approximated(f"has invalid color primaries ({problem}); it was read as linear Rec. 709.")]


def interop_id(matrix: Shaped[F64, "3 3"]) -> str | None:
    """Id of a common linear space; None for others. matrix: its primaries in Rec. 709, as columns"""
    for name, chromaticities in INTEROP_SPACES.items():
        candidate = to_rec_709(chromaticities)
        if np.abs(matrix - (np.eye(3) if candidate is None else candidate)).max() <= _MATRIX_TOLERANCE:
            return name
    return None


def chromaticities_from_matrix(matrix: Shaped[F64, "3 3"]) -> Chromaticities:
    """Primaries and white from which readers of a file compute the matrix; its white must be that of Rec. 709.

    Args:
        matrix: red, green and blue in Rec. 709, as columns.
    Raises:
        ValueError: no primaries give this matrix.
    """
    primaries_xyz = _to_xyz(np.array(REC_709)) @ matrix
    corners = np.column_stack([primaries_xyz, primaries_xyz.sum(axis=1)])
    sums = corners.sum(axis=0)
    if np.abs(sums).min() < _MIN_SUM:
        raise ValueError("one of its primaries is not a color")
    values = (corners[:2] / sums).T.ravel()
    round_trip = to_rec_709(values)
    if not np.allclose(np.eye(3) if round_trip is None else round_trip, matrix, atol=_TOLERANCE):
        raise ValueError("its white is not that of Rec. 709")
    return tuple(map(float, values))  # type: ignore[return-value]


def convert(pixels: Shaped[F32, "height width 3"], matrix: Shaped[F64, "3 3"]) -> None:
    """Convert colors in place, some rows at a time, because a map of 16k has 1.6 GB.

    Args:
        pixels: texels that are not finite may become so in all channels.
        matrix: from `to_rec_709`.
    """
    small = matrix.T.astype(np.float32)
    with np.errstate(invalid="ignore", over="ignore"):
        for first in range(0, len(pixels), _STRIP_ROWS):
            rows = slice(first, first + _STRIP_ROWS)
            pixels[rows] = pixels[rows] @ small


def _to_xyz(values: F64) -> F64:
    """Matrix from RGB to XYZ, where white has Y = 1. values: (8,). Returns: (3, 3)"""
    x, y = values.reshape(4, 2).T
    corners = np.stack([x, y, 1 - x - y])
    primaries, white = corners[:, :3], corners[:, 3]
    if abs(np.linalg.det(primaries)) < _MIN_AREA or white[1] < _MIN_WHITE:
        raise ValueError("its primaries lie on a line, or its white is black")
    scales = np.linalg.solve(primaries, white / white[1])
    if scales.min() <= 0:
        raise ValueError("its white is outside its primaries")
    return np.asarray(primaries * scales)
