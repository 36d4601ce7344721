"""Kernels that sample LUTs: of views, and of display values."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.image_io.ocio.lut import GAIN, SIZE

_ROWS_PER_RANGE = 1 << 15
_INVERSE_MAX = np.float32(1 / 65535)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _interpolate(position, table, size, out, step):  # type: ignore[no-untyped-def]
    """Replace positions between nodes, in [0, size - 1], by fractions, and write the interpolated values."""
    table_offset, stride = 0, 3
    for c in (2, 1, 0):  # blue varies fastest
        node = min(int(position[c]), size - 2)
        position[c], step[c] = position[c] - np.float32(node), stride
        table_offset, stride = table_offset + node * stride, stride * size
    for i, j in ((0, 1), (1, 2), (0, 1)):
        if position[i] < position[j]:
            position[i], position[j], step[i], step[j] = position[j], position[i], step[j], step[i]
    for c in range(3):
        out[c] = (np.float32(1) - position[0]) * table[table_offset + c]
    for i in range(3):
        table_offset += step[i]
        weight = position[i] - (position[i + 1] if i < 2 else np.float32(0))
        for c in range(3):
            out[c] += weight * table[table_offset + c]
    for c in range(3):
        out[c] *= _INVERSE_MAX


@nb.njit("void(float32[:, ::1], uint16[::1], int64, int64)", nogil=True, cache=True)
def _sample_rows(pixels, table, start, stop):  # type: ignore[no-untyped-def]
    last = np.float32(SIZE - 1)
    gain, scale = np.float32(GAIN), np.float32((SIZE - 1) / (2 * math.log1p(GAIN)))
    position, step = np.empty(3, np.float32), np.empty(3, np.int64)
    for k in range(start, stop):
        for c in range(3):
            position[c] = min(scale * np.log1p(gain * np.sqrt(max(pixels[k, c], np.float32(0)))), last)
        _interpolate(position, table, SIZE, pixels[k], step)


@nb.njit("void(float32[:, ::1], uint16[::1], int64, int64, int64)", nogil=True, cache=True)
def _sample_display_rows(pixels, table, size, start, stop):  # type: ignore[no-untyped-def]
    position, step = np.empty(3, np.float32), np.empty(3, np.int64)
    for k in range(start, stop):
        for c in range(3):
            position[c] = np.float32(size - 1) * min(max(pixels[k, c], np.float32(0)), np.float32(1))
        _interpolate(position, table, size, pixels[k], step)


def apply_lut(table: Shaped[NDArray[np.uint16], "N N N 3"], pixels: Shaped[NDArray[np.float32], "n 3"]) -> None:
    """Convert radiance to display values with a LUT, in place.

    Args:
        table: from `build_lut`.
        pixels: linear, after exposure, no NaN; C-contiguous.
    """
    flat = table.reshape(-1)
    for_ranges(lambda start, stop: _sample_rows(pixels, flat, start, stop), len(pixels), _ROWS_PER_RANGE)


def apply_display_lut(table: Shaped[NDArray[np.uint16], "N N N 3"], pixels: Shaped[NDArray[np.float32], "n 3"]) -> None:
    """Convert display values by a LUT with nodes at equal distances over [0, 1], in place.

    Args:
        table: red varies slowest; 65535 for 1. pixels: no NaN; C-contiguous.
    """
    flat, size = table.reshape(-1), len(table)
    for_ranges(lambda start, stop: _sample_display_rows(pixels, flat, size, start, stop), len(pixels), _ROWS_PER_RANGE)
