"""The environment where an eye sees past all surfaces."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_shares

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _fill(radiance, turn, gain, face, directions, start, stop, out):  # type: ignore[no-untyped-def]
    """Fill pixels [start, stop) that see nothing; bilinear, round about in u."""
    height, width = radiance.shape[0], radiance.shape[1]
    for p in range(start, stop):
        if face[p] >= 0:
            continue
        dx, dy, dz = directions[p, 0], directions[p, 1], directions[p, 2]
        x = (np.float32(math.atan2(dz, dx)) / np.float32(2 * math.pi) + turn) * width - np.float32(0.5)
        v = np.float32(0.5) - np.float32(math.asin(min(max(dy, np.float32(-1)), np.float32(1)))) / np.float32(math.pi)
        y = min(max(v * height - np.float32(0.5), np.float32(0)), np.float32(height - 1))
        left, upper = math.floor(x), math.floor(y)
        fx, fy = np.float32(x - left), np.float32(y - upper)
        column, row = np.int64(left) % width, np.int64(upper)
        beside, below = (column + 1) % width, min(row + 1, height - 1)
        for channel in range(3):
            top = radiance[row, column, channel] * (1 - fx) + radiance[row, beside, channel] * fx
            bottom = radiance[below, column, channel] * (1 - fx) + radiance[below, beside, channel] * fx
            out[p, channel] = gain[channel] * (top * (1 - fy) + bottom * fy)


def fill_sky(radiance: F32, rotation: float, gain: F32, face: NDArray[np.int32], directions: F32, out: F32) -> None:
    """Fill the pixels that see no surface.

    Args:
        radiance: of the environment, equirectangular. (height, width, 3) float32
        rotation: of it about +Y, degrees, counter-clockwise seen from above. gain: of each channel. (3,) float32
        face: that each pixel sees, −1 for none. (n,) int32. directions: of their rays, unit. (n, 3) float32
        out: written there. (n, 3) float32
    """
    args = (radiance, np.float32(0.5 + rotation / 360), gain, face, directions)
    for_shares(lambda start, stop: _fill(*args, start, stop, out), len(face))
