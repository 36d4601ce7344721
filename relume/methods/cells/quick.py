"""What arrives at cells from other cells, quickly: along the same rays, by the squares in which they come and go.

    t_j(c) = π / N Σ_r L(link(c, r), square it leaves by) h̄_j(square it comes in by)

with h̄ the functions' means over squares, and t_j in the frame of the cell. `CellLight.arriving` is what it estimates.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.lobe_grid import SIDE
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.reflecting import Arrived
from relume.parallel import for_shares
from relume.project.sent import Sent, grid_means, light_along

F32 = NDArray[np.float32]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _arriving(links, leaving, coming, sent, row_of, start, stop, irradiance, squares):  # type: ignore[no-untyped-def]
    """Sum the rays of cells [start, stop). row_of: each cell's row among the squares, −1 for none. (C,)"""
    share = np.float32(np.pi / links.shape[1])
    light = np.empty((3, links.shape[1]), np.float32)
    for cell in range(start, stop):
        light_along(sent, links[cell], leaving[cell], light)
        for channel in range(3):
            irradiance[cell, channel] = share * light[channel].sum()
        if row_of[cell] < 0:
            continue
        into = squares[row_of[cell]]
        for ray in range(links.shape[1]):
            for channel in range(3):
                into[channel, coming[cell, ray]] += share * light[channel, ray]


def arriving_quickly(cells: CellLight, sent: Sent, rows: NDArray[np.intp]) -> Arrived:
    """What arrives from other cells, whose light differs by direction.

    Args:
        cells: that it comes to. sent: by all cells. rows: those of which light vectors are wanted. (G,)
    """
    irradiance, squares = np.empty((cells.num_cells, 3), np.float32), np.zeros((len(rows), 3, SIDE * SIDE), np.float32)
    row_of = np.full(cells.num_cells, -1, np.int32)
    row_of[rows] = np.arange(len(rows))
    args = (cells.links, cells.leaving, cells.coming, sent, row_of)
    for_shares(lambda start, stop: _arriving(*args, start, stop, irradiance, squares), cells.num_cells)
    return Arrived(irradiance, squares @ grid_means().T)
