"""Where what is seen at a place of a BTF's plane is seen from another side: the height of the relief tells.

A ray towards w, which crosses the plane at x, is at height z over x + z s(w), s(w) = (w_x, w_y) / w_z. Where it meets
the relief, at height h, a ray towards v meets it too that crosses the plane at

    x_v = x + h (s(w) − s(v)) .

So values that are known from v are looked up there, when they are to be seen from w: else a mean of several directions
would show relief several times.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.btf.rings import Rings, directions
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_A_TEXEL = np.float32(2)  # steps, along a ray
_MOST_STEPS = 256


def slants(rings: Rings) -> F32:
    """s of every direction: how far its rays go sideways for each unit that they rise. (V, 2) float32"""
    w = directions(rings)
    return np.asarray(w[:, :2] / w[:, 2:], np.float32)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def slant_of(rings, x, y, z):  # type: ignore[no-untyped-def]
    """s of a direction; beyond the last ring it is the last ring's.

    Args:
        rings: the `Rings`. x, y, z: the direction, unit, above the horizon.
    """
    across = math.sqrt(x * x + y * y)
    most = np.float32(math.tan(rings.theta[rings.theta.shape[0] - 1]))
    steep: Any = max(z, np.float32(1e-6), across / most)
    return x / steep, y / steep


@nb.njit(nogil=True, cache=True, forceinline=True, **UNCOUNTED)
def _at(height, u, v):  # type: ignore[no-untyped-def]
    """Interpolate heights between texels, which repeat without end."""
    rows, columns = height.shape
    x, y = u * np.float32(columns) - np.float32(0.5), v * np.float32(rows) - np.float32(0.5)
    left, upper = math.floor(x), math.floor(y)
    fx, fy = np.float32(x - left), np.float32(y - upper)
    column, row = np.int64(left) % columns, np.int64(upper) % rows
    beside, below = (column + 1) % columns, (row + 1) % rows
    above = (np.float32(1) - fx) * height[row, column] + fx * height[row, beside]
    return (np.float32(1) - fy) * above + fy * (
        (np.float32(1) - fx) * height[below, column] + fx * height[below, beside]
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def height_seen(height, lowest, highest, u, v, slant):  # type: ignore[no-untyped-def]
    """Find how high the relief is where a ray meets it first, in steps of half a texel, linear on the last.

    Args:
        height: of the relief, sides of the texture. (height, width) float32. lowest, highest: of them.
        u, v: where the ray crosses the plane, in repeats. slant: s of it.
    """
    rows, columns = height.shape
    sideways = max(abs(slant[0]) * np.float32(columns), abs(slant[1]) * np.float32(rows)) * (highest - lowest)
    steps: Any = min(max(np.int64(math.ceil(_A_TEXEL * sideways)), 1), _MOST_STEPS)
    step, before = (lowest - highest) / np.float32(steps), highest
    over = highest - _at(height, u + highest * slant[0], v - highest * slant[1])
    for k in range(steps):
        z = highest + step * np.float32(k + 1)
        now = z - _at(height, u + z * slant[0], v - z * slant[1])
        if now <= 0:
            return before + step * over / max(over - now, np.float32(1e-9))
        over, before = now, z
    return lowest


def height_seen_numpy(height: F32, place: F64, slant: F64) -> float:
    """Do as `height_seen`, in plain NumPy: its oracle.

    Args:
        height: of the relief. (height, width). place: u and v, in repeats. (2,). slant: s of the ray. (2,)
    """
    size = np.array(height.shape[::-1])
    low, high = float(height.min()), float(height.max())
    steps = int(np.clip(np.ceil(2 * np.max(np.abs(slant) * size) * (high - low)), 1, _MOST_STEPS))
    z = np.linspace(high, low, steps + 1)
    at = (place + z[:, None] * slant * [1, -1]) * size - 0.5
    first = np.floor(at).astype(int)
    part = at - first
    relief = np.zeros(len(z))
    for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        near = np.abs(1 - right - part[:, 0]) * np.abs(1 - down - part[:, 1])
        relief += near * height[(first[:, 1] + down) % size[1], (first[:, 0] + right) % size[0]]
    over = z - relief
    met = np.flatnonzero(over[1:] <= 0)
    if not len(met):
        return low
    k = met[0]
    return float(z[k] + (z[k + 1] - z[k]) * over[k] / max(over[k] - over[k + 1], 1e-9))
