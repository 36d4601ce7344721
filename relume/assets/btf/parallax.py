"""Parallax between view directions of a BTF, from the height of its relief.

A ray toward w that crosses the plane at x is at x + z s(w) at height z, s(w) = (w_x, w_y) / w_z. If it
meets the relief at height h, the ray toward v that meets the same point crosses the plane at

    x_v = x + h (s(w) − s(v)) .

Interpolation toward w therefore looks up the values measured from v at x_v. Without it, a mean of several view
directions would show the relief as ghost images.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid, directions
from relume.core.numba_options import NO_REFCOUNT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_STEPS_PER_TEXEL = np.float32(2)  # along a ray
_MAX_STEPS = 256


def compute_shears(grid: DirectionGrid) -> Shaped[F32, "n 2"]:
    """s of every direction: horizontal distance per unit of height."""
    w = directions(grid)
    return np.asarray(w[:, :2] / w[:, 2:], np.float32)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def compute_shear(grid, x, y, z):  # type: ignore[no-untyped-def]
    """s of a direction, limited to that of the last ring.

    Args:
        grid: the `DirectionGrid`. x, y, z: the direction, unit, above the horizon.
    """
    across = math.sqrt(x * x + y * y)
    max_slope = np.float32(math.tan(grid.theta[grid.theta.shape[0] - 1]))
    denominator = max(z, np.float32(1e-6), across / max_slope)
    return x / denominator, y / denominator


@nb.njit(nogil=True, cache=True, forceinline=True, **NO_REFCOUNT)
def _interpolate_height(height, u, v):  # type: ignore[no-untyped-def]
    """Bilinear interpolation of the heights of texels, periodically repeated."""
    rows, columns = height.shape
    x, y = u * np.float32(columns) - np.float32(0.5), v * np.float32(rows) - np.float32(0.5)
    left, upper = math.floor(x), math.floor(y)
    fx, fy = np.float32(x - left), np.float32(y - upper)
    column, row = np.int64(left) % columns, np.int64(upper) % rows
    next_column, next_row = (column + 1) % columns, (row + 1) % rows
    above = (np.float32(1) - fx) * height[row, column] + fx * height[row, next_column]
    return (np.float32(1) - fy) * above + fy * (
        (np.float32(1) - fx) * height[next_row, column] + fx * height[next_row, next_column]
    )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def parallax_intersection(height, lowest, highest, u, v, shear):  # type: ignore[no-untyped-def]
    """Find the height at which a ray first meets the relief, in steps of half a texel and linear in the last.

    Args:
        height: height of the relief, in side lengths of the texture. (height, width) float32.
        lowest, highest: its range.
        u, v: crossing with the plane, in repeats. shear: s of the ray.
    """
    rows, columns = height.shape
    sideways = max(abs(shear[0]) * np.float32(columns), abs(shear[1]) * np.float32(rows)) * (highest - lowest)
    steps: Any = min(max(np.int64(math.ceil(_STEPS_PER_TEXEL * sideways)), 1), _MAX_STEPS)
    step, previous_z = (lowest - highest) / np.float32(steps), highest
    clearance = highest - _interpolate_height(height, u + highest * shear[0], v - highest * shear[1])
    for k in range(steps):
        z = highest + step * np.float32(k + 1)
        next_clearance = z - _interpolate_height(height, u + z * shear[0], v - z * shear[1])
        if next_clearance <= 0:
            return previous_z + step * clearance / max(clearance - next_clearance, np.float32(1e-9))
        clearance, previous_z = next_clearance, z
    return lowest


@nb.njit(nogil=True, cache=True)
def _visible_texels_kernel(height, shears, size, out):  # type: ignore[no-untyped-def]
    """Kernel of `visible_texels`. size: height and width of the texture. out: (n, texels), written"""
    lowest, highest = height.min(), height.max()
    rows, columns = size
    for view in range(out.shape[0]):
        shear = (shears[view, 0], shears[view, 1])
        for texel in range(out.shape[1]):
            u = np.float32((texel % columns + 0.5) / columns)
            v = np.float32((texel // columns + 0.5) / rows)
            z = parallax_intersection(height, lowest, highest, u, v, shear)
            column = np.int64(math.floor((u + z * shear[0]) * columns)) % columns
            row = np.int64(math.floor((v - z * shear[1]) * rows)) % rows
            out[view, texel] = row * columns + column


def visible_texels(
    height: Shaped[F32, "height width"], grid: DirectionGrid, size: tuple[int, int]
) -> Shaped[NDArray[np.int32], "n texels"]:
    """Texel of the relief that each texel shows from each direction: the nearest to where its ray meets the relief.

    Args:
        height: height of the relief, in side lengths of the texture; one number for a plane.
        grid: grid of the directions. size: height and width of the texture, texels.
    """
    num = size[0] * size[1]
    if height.min() == height.max():
        return np.tile(np.arange(num, dtype=np.int32), (grid.num_directions, 1))
    out = np.empty((grid.num_directions, num), np.int32)
    _visible_texels_kernel(np.ascontiguousarray(height), compute_shears(grid), size, out)
    return out
