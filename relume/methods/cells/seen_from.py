"""From where gather cells are seen by each other: the mean of the functions by which they send light."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.light.gather_rays import Pattern, cosine_ray, small_shifts_of
from relume.points import Points
from relume.project.sent import SIDE, grid_means, square_of
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, error_model="numpy")
def _count(points, links, pattern, frames, counts):  # type: ignore[no-untyped-def]
    """Count the rays of points by the cell that they hit and the square that they come from. counts: (C, SIDE²)"""
    _, normal, tangent, seed = points
    for p in range(links.shape[0]):
        n, t = normal[p], tangent[p]
        bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        shifts = small_shifts_of(pattern, seed[p])
        for ray in range(links.shape[1]):
            cell = links[p, ray]
            if cell == NO_CELL:
                continue
            x, y, z = cosine_ray(pattern.rays[ray], shifts[0])
            dx, dy, dz = t[0] * x + bx * y + n[0] * z, t[1] * x + by * y + n[1] * z, t[2] * x + bz * y + n[2] * z
            counts[cell, square_of(frames, cell, -dx, -dy, -dz)] += np.float32(1)


def seen_from(points: Points, links: NDArray[np.uint16], pattern: Pattern, frames: F32) -> F32:
    """Mean of every function over the directions in which rays see cells.

    Args:
        points: where rays leave. links: cells that they hit. (n, rays) uint16. pattern: their directions.
        frames: tangents and bitangents of the cells. (C, 2, 3) float32
    Returns:
        Zero where nothing sees a cell. (C, J) float32
    """
    counts = np.zeros((len(frames), SIDE * SIDE), np.float32)
    _count(points, links, pattern, frames, counts)
    return np.asarray(counts @ grid_means().T / np.maximum(counts.sum(axis=1, keepdims=True), 1), np.float32)
