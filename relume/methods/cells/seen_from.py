"""From where gather cells are seen by each other: the mean of the functions by which they send light."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.lobe_grid import SIDE
from relume.project.sent import grid_means
from relume.project.squares import Squares
from relume.trace.cell_tree import NO_CELL
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, error_model="numpy", **UNCOUNTED)
def _count(links, squares, counts):  # type: ignore[no-untyped-def]
    """Count rays by the cell that they hit and the square that they come from. counts: (C, SIDE²)"""
    for p in range(links.shape[0]):
        for ray in range(links.shape[1]):
            if links[p, ray] != NO_CELL:
                counts[links[p, ray], squares[p, ray]] += np.float32(1)


def seen_from(links: NDArray[np.uint16], squares: Squares, num_cells: int) -> F32:
    """Mean of every function over the directions in which rays see cells.

    Args:
        links: cells that rays hit. (n, rays) uint16. squares: in which they see them. (n, rays) uint8
        num_cells: C.
    Returns:
        Zero where nothing sees a cell. (C, J) float32
    """
    counts = np.zeros((num_cells, SIDE * SIDE), np.float32)
    _count(links, squares, counts)
    return np.asarray(counts @ grid_means().T / np.maximum(counts.sum(axis=1, keepdims=True), 1), np.float32)
