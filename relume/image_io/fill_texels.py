"""Texels without a value, from those around them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float32
from numpy.typing import NDArray

MAX_ROUNDS = 8  # a block of twice as many texels is filled, from its edge inward
MAX_TEXELS = 1_000_000


def fill_from_neighbors(
    pixels: Float32[NDArray[np.float32], "height width channels"], is_missing: Bool[NDArray[np.bool_], "height width"]
) -> None:
    """Set missing texels to the mean of the valid ones among their eight neighbors, in place.

    Args:
        pixels: any values at missing texels; zero afterwards if no valid texel is near, or too many are missing.
        is_missing: is changed.
    """
    pixels[is_missing] = 0
    for _ in range(MAX_ROUNDS):
        rows, columns = np.nonzero(is_missing)
        if not 0 < len(rows) <= MAX_TEXELS:
            return
        mean, is_filled = _neighbor_mean(pixels, is_missing, rows, columns)
        pixels[rows[is_filled], columns[is_filled]] = mean[is_filled]
        is_missing[rows[is_filled], columns[is_filled]] = False


def _neighbor_mean(
    pixels: NDArray[np.float32], is_missing: NDArray[np.bool_], rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Mean of the valid neighbors of texels, and whether there is one."""
    height, width, channels = pixels.shape
    total, count = np.zeros((len(rows), channels), np.float32), np.zeros((len(rows), 1), np.float32)
    for dy, dx in ((dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)):
        y, x = rows + dy, columns + dx
        inside = np.flatnonzero((y >= 0) & (y < height) & (x >= 0) & (x < width))
        valid = inside[~is_missing[y[inside], x[inside]]]
        total[valid] += pixels[y[valid], x[valid]]
        count[valid] += 1
    return np.asarray(total / np.maximum(count, 1), np.float32), count[:, 0] > 0
