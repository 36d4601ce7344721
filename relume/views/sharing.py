"""What gather rays bring to a view sample is shared with its neighbours in the picture.

A few hundred rays a sample leave grain as fine as the pixels, and light between surfaces hardly changes from one to the
next: a weighted mean over the eight pixels around, of samples on the same smooth piece of the same material, is nearer
to the truth than the sample alone. The weights depend on places and normals only, so that the mean is linear in light
and materials, and one for images and for operators.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

F32 = NDArray[np.float32]

_TENT = {0: 2.0, 1: 1.0}
_MIN_COS_TURN = 0.985  # normals that differ by more than 10° are of another piece
_MAX_RISE = 0.2  # off the tangent plane, over the distance


def sharing(pixel: NDArray[np.uint32], width: int, position: F32, normal: F32) -> Any:
    """Weigh a material's samples for each other; rows sum to one.

    Args:
        pixel: y · width + x of each. (n,) uint32. width: of the picture, pixels.
        position, normal: of each. (n, 3) float32
    Returns:
        (n, n) sparse, float32
    """
    order = np.argsort(pixel, kind="stable")
    key = pixel[order].astype(np.int64)
    x, y = pixel.astype(np.int64) % width, pixel.astype(np.int64) // width
    rows, columns, weights = [], [], []
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            around = np.where((x + dx >= 0) & (x + dx < width), (y + dy) * width + x + dx, -1)
            first, stop = np.searchsorted(key, around), np.searchsorted(key, around, side="right")
            num = stop - first
            row = np.repeat(np.arange(len(pixel)), num)
            within = np.arange(len(row)) - np.repeat(np.cumsum(num) - num, num)
            column = order[np.repeat(first, num) + within]
            away = (position[column] - position[row]).astype(np.float64)
            turn = np.einsum("nc,nc->n", normal[row], normal[column])
            rise = np.abs(np.einsum("nc,nc->n", normal[row].astype(np.float64), away))
            same = (turn > _MIN_COS_TURN) & (rise <= _MAX_RISE * np.linalg.norm(away, axis=1)) | (row == column)
            rows.append(row[same])
            columns.append(column[same])
            weights.append((_TENT[abs(dx)] * _TENT[abs(dy)] / np.repeat(num, num))[same])
    shape = (len(pixel), len(pixel))
    found = csr_array((np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
    found.data /= np.repeat(found.sum(axis=1), np.diff(found.indptr))
    return found.astype(np.float32)
