"""Grid of the directions of a BTF: rings about the normal, with interpolation between them.

Interpolation is linear in θ between two rings, and in φ on each: four directions with weights that are continuous and
sum to one, also across φ = 0 and at the pole. Beyond the last ring, the last ring's value is used, for light
directions times the ratio of cosines, since a BTF's values include the cosine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import MaterialError
from relume.core.numba_options import NO_REFCOUNT
from relume.math.fast_math import acos_clamped, azimuth_fraction
from relume.math.polar import polar

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

UBO_81 = ((0.0, 1), (15.0, 6), (30.0, 12), (45.0, 18), (60.0, 20), (75.0, 24))
"""θ in degrees and number of directions of each ring in the Bonn measurements, φ from 0 (Sattler 2003)."""
MAX_DIRECTIONS = 400
_MIN_RING_DIRECTIONS = 4  # directions on each ring except the first, for interpolation


class DirectionGrid(NamedTuple):
    """Rings of directions, indexed from the pole outward and by ascending φ.

    Attributes:
        theta: θ of each ring, ascending from 0, radians.
        first: index of the first direction of each ring, then the number of directions.
        shift: φ of the first direction of each ring, in steps between its directions, [0, 1).
    """

    theta: Shaped[F32, " rings"]
    first: Shaped[NDArray[np.int32], " rings+1"]
    shift: Shaped[F32, " rings"]

    @property
    def num_directions(self) -> int:
        """Number of directions on all rings."""
        return int(self.first[-1])


def make_direction_grid(theta_and_counts: Sequence[tuple[float, int]], shift: Sequence[float] = ()) -> DirectionGrid:
    """Make a grid from θ in degrees and the number of directions of each ring.

    Args:
        theta_and_counts: θ in degrees and number of directions of each ring.
        shift: as in `DirectionGrid`; by default zero.
    Raises:
        MaterialError: the first ring is not the pole, θ does not ascend, or there are too few or too many directions.
    """
    theta, count = (
        np.array([row[0] for row in theta_and_counts]),
        np.array([row[1] for row in theta_and_counts], np.int64),
    )
    shifts = np.array(shift or np.zeros(len(theta)), np.float32)
    if shifts.shape != theta.shape or not ((shifts >= 0) & (shifts < 1)).all():
        raise MaterialError("the ring shifts of the BTF must be in [0, 1), one for each ring")
    rises = len(theta) >= 2 and theta[0] == 0 and bool((np.diff(theta) > 0).all()) and theta[-1] < 90
    if not rises or count[0] != 1 or (count[1:] < _MIN_RING_DIRECTIONS).any() or count.sum() > MAX_DIRECTIONS:
        raise MaterialError(
            "the directions of the BTF are not rings about the normal: one at the pole, then at least "
            f"{_MIN_RING_DIRECTIONS} on each ring above the horizon, at most {MAX_DIRECTIONS} in total; resample it"
        )
    first = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    return DirectionGrid(np.radians(theta).astype(np.float32), first, shifts)


@lru_cache(maxsize=1)
def ubo_grid() -> DirectionGrid:
    """The grid of `UBO_81`."""
    return make_direction_grid(UBO_81)


def directions(grid: DirectionGrid) -> Shaped[F64, "n 3"]:
    """All directions of a grid, unit, local frame, z = normal."""
    count = np.diff(grid.first)
    theta = np.repeat(grid.theta.astype(np.float64), count)
    phi = np.concatenate([2 * np.pi * (np.arange(n) + start) / n for n, start in zip(count, grid.shift, strict=True)])
    return polar(theta, phi)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def interpolation_weights_at(grid, theta, azimuth_fraction, index, weight):  # type: ignore[no-untyped-def]
    """Same as `interpolation_weights`, for angles.

    Args:
        grid, index, weight: as in `interpolation_weights`. theta: radians, up to π/2. azimuth_fraction: φ / 2π.
    """
    lower = 0
    while lower < grid.theta.shape[0] - 2 and theta >= grid.theta[lower + 1]:
        lower += 1
    theta_fraction = (theta - grid.theta[lower]) / (grid.theta[lower + 1] - grid.theta[lower])
    theta_fraction = np.float32(min(max(theta_fraction, np.float32(0)), np.float32(1)))
    for k in range(2):
        first, count = grid.first[lower + k], grid.first[lower + k + 1] - grid.first[lower + k]
        position = np.float32(azimuth_fraction * count - grid.shift[lower + k])
        if position < 0:
            position += np.float32(count)
        lower_index = min(np.int64(position), count - 1)
        phi_fraction = np.float32(position - lower_index)
        ring_weight = theta_fraction if k == 1 else np.float32(1) - theta_fraction
        index[2 * k], index[2 * k + 1] = (
            first + lower_index,
            first + (lower_index + 1 if lower_index + 1 < count else 0),
        )
        weight[2 * k], weight[2 * k + 1] = ring_weight * (np.float32(1) - phi_fraction), ring_weight * phi_fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def interpolation_weights(grid, x, y, z, index, weight):  # type: ignore[no-untyped-def]
    """Find the four grid directions around a direction, and their weights.

    Args:
        grid: the `DirectionGrid`. x, y, z: the direction, unit, above the horizon.
        index: written. (4,) int32. weight: written. (4,) float32
    Returns:
        Cosine factor beyond the last ring: z over the last ring's cosine, at most one.
    """
    interpolation_weights_at(grid, acos_clamped(z), azimuth_fraction(x, y), index, weight)
    return np.float32(min(max(z, np.float32(0)) / math.cos(grid.theta[grid.theta.shape[0] - 1]), np.float32(1)))


def interpolation_weights_numpy(
    grid: DirectionGrid, w: Shaped[F64, "n 3"]
) -> tuple[Shaped[NDArray[np.int64], "n 4"], Shaped[F64, "n 4"], Shaped[F64, " n"]]:
    """NumPy version of `interpolation_weights`, as its reference in tests and for arrays.

    Returns:
        Directions, weights, cosine factors.
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
