"""Kernel that samples LUTs of views."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import for_ranges
from relume.image_io.ocio.lut import GAIN, SIZE

_ROWS_PER_RANGE = 1 << 15
_INVERSE_MAX = np.float32(1 / 65535)


@nb.njit("void(float32[:, ::1], uint16[::1], int64, int64)", nogil=True, cache=True)
def _sample_rows(pixels, table, start, stop):  # type: ignore[no-untyped-def]
    last = SIZE - 1
    gain, scale = np.float32(GAIN), np.float32(last / (2 * math.log1p(GAIN)))
    fraction, step = np.empty(3, np.float32), np.empty(3, np.int64)
    for k in range(start, stop):
        table_offset, stride = 0, 3
        for c in (2, 1, 0):  # blue varies fastest
            position = min(scale * np.log1p(gain * np.sqrt(max(pixels[k, c], np.float32(0)))), np.float32(last))
            node = min(int(position), last - 1)
            fraction[c], step[c] = position - np.float32(node), stride
            table_offset, stride = table_offset + node * stride, stride * SIZE
        for i, j in ((0, 1), (1, 2), (0, 1)):
            if fraction[i] < fraction[j]:
                fraction[i], fraction[j], step[i], step[j] = fraction[j], fraction[i], step[j], step[i]
        weight = np.float32(1) - fraction[0]
        red, green, blue = (
            weight * table[table_offset],
            weight * table[table_offset + 1],
            weight * table[table_offset + 2],
        )
        for i in range(3):
            table_offset += step[i]
            weight = fraction[i] - (fraction[i + 1] if i < 2 else np.float32(0))
            red, green, blue = (
                red + weight * table[table_offset],
                green + weight * table[table_offset + 1],
                blue + weight * table[table_offset + 2],
            )
        pixels[k, 0], pixels[k, 1], pixels[k, 2] = red * _INVERSE_MAX, green * _INVERSE_MAX, blue * _INVERSE_MAX


def apply_lut(table: Shaped[NDArray[np.uint16], "N N N 3"], pixels: Shaped[NDArray[np.float32], "n 3"]) -> None:
    """Convert radiance to display values with a LUT, in place.

    Args:
        table: from `build_lut`.
        pixels: linear, after exposure, no NaN; C-contiguous.
    """
    flat = table.reshape(-1)
    for_ranges(lambda start, stop: _sample_rows(pixels, flat, start, stop), len(pixels), _ROWS_PER_RANGE)
