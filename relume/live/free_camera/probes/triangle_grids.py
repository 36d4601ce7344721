"""Grids of nodes inside triangles: their numbering, the nodes around a point, and midpoints of coarser grids.

A grid has R rows, parallel to the first edge of its face, and (R + 1)(R + 2) / 2 nodes. Every 2^l-th node in both
directions forms the grid with R / 2^l rows; each other node of the next finer grid is the midpoint of one of its edges.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]


class ProbeGrid(NamedTuple):
    """The grid of every side of every face; on side 0 the corners are counterclockwise.

    Attributes:
        num_rows: R; 0 if the side has no nodes.
        first: its first node in `node_index`.
        node_index: lattice node of each grid node.
    """

    num_rows: Shaped[NDArray[np.uint8], "faces 2"]
    first: Shaped[NDArray[np.uint32], "faces 2"]
    node_index: Shaped[NDArray[np.uint32], " nodes"]


class ProbeDensity(NamedTuple):
    """Probe spacing at the nodes of grids, relative to a base spacing.

    Attributes:
        probe_grid: the grids, without lattice nodes.
        power: log2 of the relative spacing.
    """

    probe_grid: ProbeGrid
    power: Shaped[NDArray[np.int8], " nodes"]

    def at(self, steps: GridSteps) -> Shaped[NDArray[np.int8], " n"]:
        """Return the power at the nodes of other grids on the same faces, the least of the three surrounding nodes."""
        out = np.empty(len(steps.grid), np.int8)
        parallel_for_chunks(
            lambda start, stop: _surrounding_minimum(self.probe_grid, self.power, steps, start, stop, out), len(out)
        )
        return out

    def face_extremes(self) -> tuple[Shaped[NDArray[np.int8], " faces"], Shaped[NDArray[np.int8], " faces"]]:
        """Return the least and the greatest power on each face, 0 if it has no nodes."""
        rows = self.probe_grid.num_rows
        face = np.repeat(np.arange(rows.size) // 2, num_nodes(rows).ravel())
        lowest, highest = np.full(len(rows), 127, np.int8), np.full(len(rows), -128, np.int8)
        np.minimum.at(lowest, face, self.power)
        np.maximum.at(highest, face, self.power)
        return np.where(lowest <= highest, lowest, 0), np.where(lowest <= highest, highest, 0)


class GridSteps(NamedTuple):
    """Positions of nodes in their grids.

    Attributes:
        grid: face · 2 + side.
        i, j: steps toward the second and the third corner.
        rows: of the grid.
    """

    grid: Shaped[I32, " n"]
    i: Shaped[I32, " n"]
    j: Shaped[I32, " n"]
    rows: Shaped[I32, " n"]


def num_nodes(rows: Shaped[NDArray[np.integer], " *grids"]) -> Shaped[I64, " *grids"]:
    """Return the number of nodes of grids; 0 without rows."""
    wide = rows.astype(np.int64)
    return np.where(wide > 0, (wide + 1) * (wide + 2) // 2, 0)


def first_nodes(rows: Shaped[NDArray[np.integer], " *grids"]) -> Shaped[NDArray[np.uint32], " *grids"]:
    """Return the first node of each grid, for successive grids. rows: of each"""
    counts = num_nodes(rows).ravel()
    return (np.cumsum(counts) - counts).reshape(rows.shape).astype(np.uint32)


@nb.njit(nogil=True, cache=True, inline="always")
def node_index(rows, i, j):  # type: ignore[no-untyped-def]
    """Index of a node in a grid of `rows` rows: i steps toward the second corner, j toward the third."""
    return i * (rows + 1) - (i * (i - 1)) // 2 + j


@nb.njit(nogil=True, cache=True, inline="always")
def surrounding_nodes(probe_grid, face, side, u, v):  # type: ignore[no-untyped-def]
    """Return the three nodes around a point in a face, and their weights.

    Args:
        probe_grid: with nodes there. face, side: of the point. u, v: barycentric, of the second and third corner.
    """
    rows = np.int64(probe_grid.num_rows[face, side])
    x: Any = u * rows
    y: Any = v * rows
    i: Any = min(max(np.int64(x), 0), rows - 1)
    j: Any = min(max(np.int64(y), 0), rows - 1 - i)
    fx: Any = x - i
    fy: Any = y - j
    first = np.int64(probe_grid.first[face, side])
    b, c = first + node_index(rows, i + 1, j), first + node_index(rows, i, j + 1)
    if fx + fy <= 1 or i + j == rows - 1:
        return first + node_index(rows, i, j), b, c, np.float32(1 - fx - fy), np.float32(fx), np.float32(fy)
    return first + node_index(rows, i + 1, j + 1), b, c, np.float32(fx + fy - 1), np.float32(1 - fy), np.float32(1 - fx)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _surrounding_minimum(probe_grid, power, steps, start, stop, out):  # type: ignore[no-untyped-def]
    """Write the least power of the three nodes around each of the steps [start, stop)."""
    for k in range(start, stop):
        rows = np.float32(steps.rows[k])
        u, v = np.float32(steps.i[k]) / rows, np.float32(steps.j[k]) / rows
        a, b, c, _, _, _ = surrounding_nodes(probe_grid, steps.grid[k] // 2, steps.grid[k] % 2, u, v)
        out[k] = min(power[a], power[b], power[c])


def enumerate_nodes(num_rows: Shaped[NDArray[np.integer], " *grids"]) -> GridSteps:
    """List the nodes of all grids in the order of `node_index`."""
    flat = num_rows.ravel().astype(np.int32)
    first = first_nodes(flat).astype(np.int64)
    grid = np.repeat(np.arange(len(flat), dtype=np.int32), num_nodes(flat))
    i, j = np.empty(len(grid), np.int32), np.empty(len(grid), np.int32)
    for rows in map(int, np.unique(flat[flat > 0])):
        steps = np.array([(i, j) for i in range(rows + 1) for j in range(rows + 1 - i)])
        node_indices = first[flat == rows, None] + np.arange(len(steps))
        i[node_indices], j[node_indices] = steps.T
    return GridSteps(grid, i, j, flat[grid])


def find_edge_midpoints(
    steps: GridSteps, first: Shaped[NDArray[np.integer], " *grids"], nodes: Shaped[NDArray[np.intp], " n"], step: int
) -> tuple[Shaped[I64, " m"], Shaped[I64, " m"], Shaped[I64, " m"]]:
    """Return the nodes that are midpoints of edges of 2 · `step` steps, and the ends of these edges.

    Args:
        steps, first: of all grids. nodes: candidates. step: a power of two.
    Returns:
        The nodes, and both ends.
    """
    i, j = steps.i[nodes], steps.j[nodes]
    is_midpoint = (i % step == 0) & (j % step == 0) & ((i % (2 * step) != 0) | (j % (2 * step) != 0))
    nodes, i, j = nodes[is_midpoint], i[is_midpoint], j[is_midpoint]
    along, across = np.where(i % (2 * step) != 0, step, 0), np.where(j % (2 * step) != 0, step, 0)
    across = np.where((along > 0) & (across > 0), -across, across)  # the diagonal goes the other way
    grid_start, rows = first.ravel()[steps.grid[nodes]].astype(np.int64), steps.rows[nodes]
    end_a, end_b = (grid_start + node_index(rows, i + sign * along, j + sign * across) for sign in (-1, 1))
    return nodes, end_a, end_b
