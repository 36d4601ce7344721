"""The grid of squares by which gather cells send light, and finer bins of light that comes straight to them.

A direction has the place (x, y) / (1 + z) on a disc. What looks the same from all around and in a mirror need be known
for places with x ≥ y ≥ 0 alone: others are mapped there by one of eight mirrorings.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

SIDE = 16
"""Squares across the disc of all places."""
NUM_DIRECTION_BINS = SIDE * SIDE

FINE_BINS_PER_RADIUS = 24  # from the middle of the disc to its rim
NUM_FINE_BINS = FINE_BINS_PER_RADIUS * (FINE_BINS_PER_RADIUS + 1) // 2
NUM_REFLECTIONS = 8  # x negated, 1; y negated, 2; then both exchanged, 4
_RIM_RADIUS, _RIM_WEIGHT, _SUBDIVISION = 0.999, 1e-9, 8


def _disk_grid(side: int) -> tuple[F64, F64]:
    """Middles of `side` × `side` squares of the disc. (side, side) each"""
    coordinates = (np.arange(side) + 0.5) * (2 / side) - 1
    x, y = np.meshgrid(coordinates, coordinates, indexing="ij")
    return x, y


def directions_at(x: F64, y: F64) -> F64:
    """Directions at places of the disc; those off it are drawn to its rim. (..., 3)"""
    r2 = x * x + y * y
    scale = np.minimum(1, _RIM_RADIUS / np.maximum(np.sqrt(r2), _RIM_RADIUS))
    denominator = 1 + r2 * scale**2
    return np.stack([2 * x * scale / denominator, 2 * y * scale / denominator, 2 / denominator - 1], axis=-1)


def bin_index(directions: F64) -> NDArray[np.intp]:
    """Squares that directions lie in. directions: (..., 3), those below the horizon on the rim"""
    disk_point = directions[..., :2] / (1 + np.maximum(directions[..., 2:], 0))
    across, along = np.moveaxis(np.clip((SIDE / 2) * (1 + disk_point), 0, SIDE - 1).astype(np.intp), -1, 0)
    return np.asarray(across * SIDE + along)


def bin_centers() -> F64:
    """Middles of all squares. (`NUM_DIRECTION_BINS`, 3)"""
    return directions_at(*_disk_grid(SIDE)).reshape(-1, 3)


def offsets_in_bin() -> tuple[F64, F64]:
    """Directions all over each square, by the rows and columns of squares, and cos θ dω of each.

    Returns:
        (SIDE, n, SIDE, n, 3), where there are none on the rim beside; (SIDE, n, SIDE, n), next to nothing there
    """
    x, y = _disk_grid(SIDE * _SUBDIVISION)
    directions, shape = directions_at(x, y), (SIDE, _SUBDIVISION, SIDE, _SUBDIVISION)
    up = directions[..., 2]
    projected_solid_angles = (
        np.where(x * x + y * y < 1, up * (1 + up) ** 2, _RIM_WEIGHT) * (2 / (SIDE * _SUBDIVISION)) ** 2
    )
    return directions.reshape(*shape, 3), projected_solid_angles.reshape(shape)


def bin_solid_angles() -> F64:
    """∫ cos θ dω over each square. (`NUM_DIRECTION_BINS`,)"""
    return np.asarray(offsets_in_bin()[1].sum(axis=(1, 3)).ravel())


def fine_bin_centers() -> F64:
    """Directions of the bins with x ≥ y ≥ 0, row after row: bin i (i + 1) / 2 + j. (`NUM_FINE_BINS`, 3)"""
    i, j = np.tril_indices(FINE_BINS_PER_RADIUS)
    return directions_at((i + 0.5) / FINE_BINS_PER_RADIUS, (j + 0.5) / FINE_BINS_PER_RADIUS)


@lru_cache(maxsize=1)
def reflected_bins() -> NDArray[np.uint8]:
    """Where each square goes by each mirroring. (`NUM_REFLECTIONS`, `NUM_DIRECTION_BINS`) uint8"""
    across, along = np.divmod(np.arange(NUM_DIRECTION_BINS), SIDE)
    reflected = []
    for reflection in range(NUM_REFLECTIONS):
        x = SIDE - 1 - across if reflection & 1 else across
        y = SIDE - 1 - along if reflection & 2 else along
        reflected.append(y * SIDE + x if reflection & 4 else x * SIDE + y)
    return np.array(reflected, np.uint8)
