"""The directions that a BTF was measured in: rings about the normal, and how values between them are found.

Between two rings the mean goes along θ, on each ring along φ: four directions, whose weights are continuous everywhere
and sum to one. There is no seam where φ is 0, and none at the pole. Beyond the last ring it is the last ring's value;
for light times what is left of the cosine, which a BTF's values contain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.errors import MaterialError
from relume.core.numba_options import UNCOUNTED
from relume.math.fast_math import acos_clamped, azimuth_fraction

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

UBO_81 = ((0.0, 1), (15.0, 6), (30.0, 12), (45.0, 18), (60.0, 20), (75.0, 24))
"""Degrees of θ and directions of each ring of the Bonn measurements, φ from 0 on (Sattler 2003)."""
MAX_DIRECTIONS = 400
_MIN_RING_DIRECTIONS = 4  # directions of rings but the first: fewer leave no room for a mean


class DirectionGrid(NamedTuple):
    """Rings of directions, numbered from the pole outwards, on each by rising φ.

    Attributes:
        theta: of each ring, rising from 0, radians. (rings,) float32
        first: number of the first direction of each, then the number of all. (rings + 1,) int32
        shift: φ of the first direction of each, in steps from one to the next, [0, 1). (rings,) float32
    """

    theta: F32
    first: NDArray[np.int32]
    shift: F32

    @property
    def num_directions(self) -> int:
        """Of all rings."""
        return int(self.first[-1])


def make_direction_grid(theta_and_counts: Sequence[tuple[float, int]], shift: Sequence[float] = ()) -> DirectionGrid:
    """Rings from their θ in degrees and how many directions each has.

    Args:
        theta_and_counts: θ and number of each. shift: as in `DirectionGrid`; 0 for all where there is none.
    Raises:
        MaterialError: they do not begin with the pole, do not rise, or are too many.
    """
    theta, count = (
        np.array([row[0] for row in theta_and_counts]),
        np.array([row[1] for row in theta_and_counts], np.int64),
    )
    shifts = np.array(shift or np.zeros(len(theta)), np.float32)
    if shifts.shape != theta.shape or not ((shifts >= 0) & (shifts < 1)).all():
        raise MaterialError("the rings of the BTF's directions are each turned by a share of a step, from 0 to below 1")
    rises = len(theta) >= 2 and theta[0] == 0 and bool((np.diff(theta) > 0).all()) and theta[-1] < 90
    if not rises or count[0] != 1 or (count[1:] < _MIN_RING_DIRECTIONS).any() or count.sum() > MAX_DIRECTIONS:
        raise MaterialError(
            "the directions of the BTF are no rings about the normal: one at the pole, then at least "
            f"{_MIN_RING_DIRECTIONS} on each ring above the horizon, at most {MAX_DIRECTIONS} in all"
        )
    first = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    return DirectionGrid(np.radians(theta).astype(np.float32), first, shifts)


@lru_cache(maxsize=1)
def ubo_grid() -> DirectionGrid:
    """Those of `UBO_81`."""
    return make_direction_grid(UBO_81)


def directions(grid: DirectionGrid) -> F64:
    """All of them, unit, local frame, z = normal. (n, 3)"""
    count = np.diff(grid.first)
    theta = np.repeat(grid.theta.astype(np.float64), count)
    phi = np.concatenate([2 * np.pi * (np.arange(n) + start) / n for n, start in zip(count, grid.shift, strict=True)])
    return polar(theta, phi)


def polar(theta: F64, phi: F64) -> F64:
    """Unit vectors of angles in radians. (n, 3)"""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def interpolation_weights_at(grid, theta, azimuth_fraction, index, weight):  # type: ignore[no-untyped-def]
    """Do as `interpolation_weights` of angles.

    Args:
        grid, index, weight: as there. theta: radians, up to π/2. azimuth_fraction: φ, a share of a turn.
    """
    lower = 0
    while lower < grid.theta.shape[0] - 2 and theta >= grid.theta[lower + 1]:
        lower += 1
    theta_fraction: Any = (theta - grid.theta[lower]) / (grid.theta[lower + 1] - grid.theta[lower])
    theta_fraction = np.float32(min(max(theta_fraction, np.float32(0)), np.float32(1)))
    for k in range(2):
        first, count = grid.first[lower + k], grid.first[lower + k + 1] - grid.first[lower + k]
        position = np.float32(azimuth_fraction * count - grid.shift[lower + k])
        if position < 0:
            position += np.float32(count)
        lower_index: Any = min(np.int64(position), count - 1)
        phi_fraction = np.float32(position - lower_index)
        ring_weight = theta_fraction if k == 1 else np.float32(1) - theta_fraction
        index[2 * k], index[2 * k + 1] = (
            first + lower_index,
            first + (lower_index + 1 if lower_index + 1 < count else 0),
        )
        weight[2 * k], weight[2 * k + 1] = ring_weight * (np.float32(1) - phi_fraction), ring_weight * phi_fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def interpolation_weights(grid, x, y, z, index, weight):  # type: ignore[no-untyped-def]
    """Find the four directions about one, and their weights.

    Args:
        grid: the `DirectionGrid`. x, y, z: the direction, unit, above the horizon.
        index: written. (4,) int32. weight: written. (4,) float32
    Returns:
        What is left of the cosine beyond the last ring: z over the last ring's, at most one.
    """
    interpolation_weights_at(grid, acos_clamped(z), azimuth_fraction(x, y), index, weight)
    return np.float32(min(max(z, np.float32(0)) / math.cos(grid.theta[grid.theta.shape[0] - 1]), np.float32(1)))


def interpolation_weights_numpy(grid: DirectionGrid, w: F64) -> tuple[NDArray[np.int64], F64, F64]:
    """Do as `interpolation_weights` for directions (n, 3), in plain NumPy: its oracle.

    Returns:
        Directions (n, 4), weights (n, 4), what is left of the cosine (n,).
    """
    theta = np.arccos(np.clip(w[:, 2], 0, 1))
    all_theta, first = grid.theta.astype(np.float64), grid.first.astype(np.int64)
    lower = np.clip(np.searchsorted(all_theta, theta, side="right") - 1, 0, len(all_theta) - 2)
    theta_fraction = np.clip((theta - all_theta[lower]) / (all_theta[lower + 1] - all_theta[lower]), 0, 1)
    azimuth_fraction = np.arctan2(w[:, 1], w[:, 0]) / (2 * np.pi) % 1.0
    index, weight = [], []
    for ring, ring_weight in ((lower, 1 - theta_fraction), (lower + 1, theta_fraction)):
        count = first[ring + 1] - first[ring]
        position = (azimuth_fraction * count - grid.shift[ring]) % count
        lower_index = np.minimum(position.astype(np.int64), count - 1)
        phi_fraction = position - lower_index
        index += [first[ring] + lower_index, first[ring] + (lower_index + 1) % count]
        weight += [ring_weight * (1 - phi_fraction), ring_weight * phi_fraction]
    cosine_ratio = np.minimum(np.maximum(w[:, 2], 0) / np.cos(all_theta[-1]), 1)
    return np.stack(index, axis=1), np.stack(weight, axis=1), cosine_ratio
