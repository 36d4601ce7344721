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
NUM_SQUARES = SIDE * SIDE

HALF_BINS = 24  # from the middle of the disc to its rim
NUM_BINS = HALF_BINS * (HALF_BINS + 1) // 2
NUM_MIRRORINGS = 8  # x negated, 1; y negated, 2; then both exchanged, 4
_RIM, _LITTLE, _FINER = 0.999, 1e-9, 8


def _places(side: int) -> tuple[F64, F64]:
    """Middles of `side` × `side` squares of the disc. (side, side) each"""
    place = (np.arange(side) + 0.5) * (2 / side) - 1
    x, y = np.meshgrid(place, place, indexing="ij")
    return x, y


def directions_at(x: F64, y: F64) -> F64:
    """Directions at places of the disc; those off it are drawn to its rim. (..., 3)"""
    r2 = x * x + y * y
    inward = np.minimum(1, _RIM / np.maximum(np.sqrt(r2), _RIM))
    near = 1 + r2 * inward**2
    return np.stack([2 * x * inward / near, 2 * y * inward / near, 2 / near - 1], axis=-1)


def squares_of(directions: F64) -> NDArray[np.intp]:
    """Squares that directions lie in. directions: (..., 3), those below the horizon on the rim"""
    place = directions[..., :2] / (1 + np.maximum(directions[..., 2:], 0))
    across, along = np.moveaxis(np.clip((SIDE / 2) * (1 + place), 0, SIDE - 1).astype(np.intp), -1, 0)
    return np.asarray(across * SIDE + along)


def square_middles() -> F64:
    """Middles of all squares. (`NUM_SQUARES`, 3)"""
    return directions_at(*_places(SIDE)).reshape(-1, 3)


def within_squares() -> tuple[F64, F64]:
    """Directions all over each square, by the rows and columns of squares, and cos θ dω of each.

    Returns:
        (SIDE, n, SIDE, n, 3), where there are none on the rim beside; (SIDE, n, SIDE, n), next to nothing there
    """
    x, y = _places(SIDE * _FINER)
    directions, shape = directions_at(x, y), (SIDE, _FINER, SIDE, _FINER)
    up = directions[..., 2]
    projected = np.where(x * x + y * y < 1, up * (1 + up) ** 2, _LITTLE) * (2 / (SIDE * _FINER)) ** 2
    return directions.reshape(*shape, 3), projected.reshape(shape)


def square_areas() -> F64:
    """∫ cos θ dω over each square. (`NUM_SQUARES`,)"""
    return np.asarray(within_squares()[1].sum(axis=(1, 3)).ravel())


def bin_middles() -> F64:
    """Directions of the bins with x ≥ y ≥ 0, row after row: bin i (i + 1) / 2 + j. (`NUM_BINS`, 3)"""
    i, j = np.tril_indices(HALF_BINS)
    return directions_at((i + 0.5) / HALF_BINS, (j + 0.5) / HALF_BINS)


@lru_cache(maxsize=1)
def mirrored_squares() -> NDArray[np.uint8]:
    """Where each square goes by each mirroring. (`NUM_MIRRORINGS`, `NUM_SQUARES`) uint8"""
    across, along = np.divmod(np.arange(NUM_SQUARES), SIDE)
    found = []
    for mirroring in range(NUM_MIRRORINGS):
        x = SIDE - 1 - across if mirroring & 1 else across
        y = SIDE - 1 - along if mirroring & 2 else along
        found.append(y * SIDE + x if mirroring & 4 else x * SIDE + y)
    return np.array(found, np.uint8)
