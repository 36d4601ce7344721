"""The kernel that samples tables of views; `relume.imageio.ocio.lut.sample` is its twin."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.imageio.ocio.lut import GAIN, SIZE
from relume.parallel import for_ranges

_ROWS_AT_ONCE = 1 << 15
_ONE = np.float32(1 / 65535)


@nb.njit("void(float32[:, ::1], uint16[::1], int64, int64)", nogil=True, cache=True)
def _sample_rows(pixels, table, start, stop):  # type: ignore[no-untyped-def]
    last = SIZE - 1
    gain, scale = np.float32(GAIN), np.float32(last / (2 * math.log1p(GAIN)))
    part, step = np.empty(3, np.float32), np.empty(3, np.int64)
    for k in range(start, stop):
        at, stride = 0, 3
        for c in (2, 1, 0):  # blue is the quickest
            place = min(scale * np.log1p(gain * np.sqrt(max(pixels[k, c], np.float32(0)))), np.float32(last))
            node = min(int(place), last - 1)
            part[c], step[c] = place - np.float32(node), stride
            at, stride = at + node * stride, stride * SIZE
        for i, j in ((0, 1), (1, 2), (0, 1)):
            if part[i] < part[j]:
                part[i], part[j], step[i], step[j] = part[j], part[i], step[j], step[i]
        weight = np.float32(1) - part[0]
        red, green, blue = weight * table[at], weight * table[at + 1], weight * table[at + 2]
        for i in range(3):
            at += step[i]
            weight = part[i] - (part[i + 1] if i < 2 else np.float32(0))
            red, green, blue = red + weight * table[at], green + weight * table[at + 1], blue + weight * table[at + 2]
        pixels[k, 0], pixels[k, 1], pixels[k, 2] = red * _ONE, green * _ONE, blue * _ONE


def show_by(table: NDArray[np.uint16], pixels: NDArray[np.float32]) -> None:
    """Turn light into display values by a table, in place; see `sample`.

    Args:
        table: as `bake` makes it. (N, N, N, 3)
        pixels: linear, after exposure, no NaN; C-contiguous. (n, 3)
    """
    flat = table.reshape(-1)
    for_ranges(lambda start, stop: _sample_rows(pixels, flat, start, stop), len(pixels), _ROWS_AT_ONCE)
