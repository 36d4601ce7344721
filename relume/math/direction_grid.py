"""Direction bins in which patches reflect light, and finer bins for direct light on patches.

A direction (x, y, z) maps to the point (x, y) / (1 + z) on a disk. Isotropic, mirror-symmetric quantities need storage
only for x ≥ y ≥ 0: one of eight reflections maps other directions there.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]

SIDE = 16
"""Bins across the disk, which represents the hemisphere."""
NUM_DIRECTION_BINS = SIDE * SIDE

FINE_BINS_PER_RADIUS = 24  # from the center of the disk to its edge
NUM_FINE_BINS = FINE_BINS_PER_RADIUS * (FINE_BINS_PER_RADIUS + 1) // 2
NUM_REFLECTIONS = 8  # bits: 1 negates x, 2 negates y, 4 then swaps both
_RIM_RADIUS, _RIM_WEIGHT, _SUBDIVISION = 0.999, 1e-9, 8


def _disk_grid(side: int) -> tuple[F64, F64]:
    """Centers of `side` × `side` bins of the disk. (side, side) each"""
    coordinates = (np.arange(side) + 0.5) * (2 / side) - 1
    x, y = np.meshgrid(coordinates, coordinates, indexing="ij")
    return x, y


def directions_at(x: Shaped[F64, "*batch"], y: Shaped[F64, "*batch"]) -> Shaped[F64, "*batch 3"]:
    """Map points of the disk to unit directions; points off the disk are moved to its edge."""
    r2 = x * x + y * y
    scale = np.minimum(1, _RIM_RADIUS / np.maximum(np.sqrt(r2), _RIM_RADIUS))
    denominator = 1 + r2 * scale**2
    return np.stack([2 * x * scale / denominator, 2 * y * scale / denominator, 2 / denominator - 1], axis=-1)


def bin_index(directions: Shaped[F64, "*batch 3"]) -> NDArray[np.intp]:
    """Bin of each direction; directions below the horizon count as on the horizon."""
    disk_point = directions[..., :2] / (1 + np.maximum(directions[..., 2:], 0))
    across, along = np.moveaxis(np.clip((SIDE / 2) * (1 + disk_point), 0, SIDE - 1).astype(np.intp), -1, 0)
    return np.asarray(across * SIDE + along)


def bin_centers() -> Shaped[F64, "bins 3"]:
    """Center directions of all bins."""
    return directions_at(*_disk_grid(SIDE)).reshape(-1, 3)


def offsets_in_bin() -> tuple[F64, F64]:
    """Directions of a regular subdivision of each bin, and their projected solid angles cos θ dω.

    Returns:
        (SIDE, n, SIDE, n, 3) directions, at the edge of the disk if they lie off it; (SIDE, n, SIDE, n) weights, nearly
        zero off the disk
    """
    x, y = _disk_grid(SIDE * _SUBDIVISION)
    directions, shape = directions_at(x, y), (SIDE, _SUBDIVISION, SIDE, _SUBDIVISION)
    up = directions[..., 2]
    projected_solid_angles = (
        np.where(x * x + y * y < 1, up * (1 + up) ** 2, _RIM_WEIGHT) * (2 / (SIDE * _SUBDIVISION)) ** 2
    )
    return directions.reshape(*shape, 3), projected_solid_angles.reshape(shape)


def bin_solid_angles() -> Shaped[F64, " bins"]:
    """∫ cos θ dω over each bin."""
    return np.asarray(offsets_in_bin()[1].sum(axis=(1, 3)).ravel())


def fine_bin_centers() -> Shaped[F64, "bins 3"]:
    """Center directions of the fine bins with x ≥ y ≥ 0, row by row: bin i (i + 1) / 2 + j."""
    i, j = np.tril_indices(FINE_BINS_PER_RADIUS)
    return directions_at((i + 0.5) / FINE_BINS_PER_RADIUS, (j + 0.5) / FINE_BINS_PER_RADIUS)


@lru_cache(maxsize=1)
def reflected_bins() -> Shaped[NDArray[np.uint8], "8 bins"]:
    """Map each bin by each reflection to a bin."""
    across, along = np.divmod(np.arange(NUM_DIRECTION_BINS), SIDE)
    reflected = []
    for reflection in range(NUM_REFLECTIONS):
        x = SIDE - 1 - across if reflection & 1 else across
        y = SIDE - 1 - along if reflection & 2 else along
        reflected.append(y * SIDE + x if reflection & 4 else x * SIDE + y)
    return np.array(reflected, np.uint8)
