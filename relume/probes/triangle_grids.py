"""Grids of nodes inside triangles: node counts, numbering, surrounding nodes, and midpoints of coarser grids.

A grid has R rows, parallel to the first edge of its face, and (R + 1)(R + 2) / 2 nodes. Nodes at every 2^l-th step in
both directions form the grid of R / 2^l rows; every other node is the midpoint of an edge of that grid.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks

I32 = NDArray[np.int32]
I64 = NDArray[np.int64]


class ProbeGrid(NamedTuple):
    """The grids of all sides of all faces; side 0 is the one from which the corners are counterclockwise.

    Attributes:
        num_rows: R; 0 if the side has no nodes. first: first node of each grid in `node_index`.
        node_index: lattice node of each grid node.
    """

    num_rows: Shaped[NDArray[np.uint8], "faces 2"]
    first: Shaped[NDArray[np.uint32], "faces 2"]
    node_index: Shaped[NDArray[np.uint32], " grid_nodes"]


class ProbeDensity(NamedTuple):
    """Spacing of probes relative to the finest, at the nodes of grids.

    Attributes:
        probe_grid: probe grid of the nodes; not merged yet. power: power of two.
    """

    probe_grid: ProbeGrid
    power: Shaped[NDArray[np.int8], " grid_nodes"]

    def at(self, steps: GridSteps) -> Shaped[NDArray[np.int8], " n"]:
        """Evaluate at the nodes of other grids on the same faces: the least of the three surrounding nodes."""
        out = np.empty(len(steps.grid), np.int8)
        parallel_for_chunks(
            lambda start, stop: _surrounding_minimum(self.probe_grid, self.power, steps, start, stop, out), len(out)
        )
        return out

    def face_extremes(self) -> tuple[Shaped[NDArray[np.int8], " faces"], Shaped[NDArray[np.int8], " faces"]]:
        """Return the least and the largest power on each face; 0 if it has no nodes."""
        rows = self.probe_grid.num_rows
        face = np.repeat(np.arange(rows.size) // 2, num_nodes(rows).ravel())
        lowest, highest = np.full(len(rows), 127, np.int8), np.full(len(rows), -128, np.int8)
        np.minimum.at(lowest, face, self.power)
        np.maximum.at(highest, face, self.power)
        return np.where(lowest <= highest, lowest, 0), np.where(lowest <= highest, highest, 0)


class GridSteps(NamedTuple):
    """Positions of nodes in their grids.

    Attributes:
        grid: face · 2 + side. i, j: steps toward the second and the third corner. rows: rows of the grid.
    """

    grid: Shaped[I32, " n"]
    i: Shaped[I32, " n"]
    j: Shaped[I32, " n"]
    rows: Shaped[I32, " n"]


def num_nodes(rows: NDArray[np.integer]) -> I64:
    """Number of nodes of grids with so many rows; zero for no rows."""
    wide = rows.astype(np.int64)
    return np.where(wide > 0, (wide + 1) * (wide + 2) // 2, 0)


def first_nodes(rows: NDArray[np.integer]) -> NDArray[np.uint32]:
    """Offset of the first node of each grid in the concatenation. rows: rows of each, any shape"""
    counts = num_nodes(rows).ravel()
    return (np.cumsum(counts) - counts).reshape(rows.shape).astype(np.uint32)


@nb.njit(nogil=True, cache=True, inline="always")
def node_index(rows, i, j):  # type: ignore[no-untyped-def]
    """Index of a node in a grid of `rows` rows: i steps toward the second corner, j toward the third."""
    return i * (rows + 1) - (i * (i - 1)) // 2 + j


@nb.njit(nogil=True, cache=True, inline="always")
def surrounding_nodes(probe_grid, face, side, u, v):  # type: ignore[no-untyped-def]
    """Find the three nodes that surround a point in a face, and their weights.

    Args:
        probe_grid: with nodes on this side. face, side: face and side of the point.
        u, v: barycentric, of the second and third
            corner.
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


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _surrounding_minimum(probe_grid, power, steps, start, stop, out):  # type: ignore[no-untyped-def]
    """Compute the minimum over the three nodes that surround each of the steps [start, stop)."""
    for k in range(start, stop):
        rows = np.float32(steps.rows[k])
        u, v = np.float32(steps.i[k]) / rows, np.float32(steps.j[k]) / rows
        a, b, c, _, _, _ = surrounding_nodes(probe_grid, steps.grid[k] // 2, steps.grid[k] % 2, u, v)
        out[k] = min(power[a], power[b], power[c])


def enumerate_nodes(num_rows: NDArray[np.integer]) -> GridSteps:
    """List the nodes of all grids, in the order of `node_index`. num_rows: (faces, 2)"""
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
    steps: GridSteps, first: NDArray[np.integer], nodes: Shaped[NDArray[np.intp], " n"], step: int
) -> tuple[Shaped[I64, " m"], Shaped[I64, " m"], Shaped[I64, " m"]]:
    """Select nodes that are midpoints of edges of 2 · `step` steps, with the ends of these edges.

    Args:
        steps, first: arrays of all grids. nodes: to test. step: a power of two.
    Returns:
        The midpoints, and both ends.
    """
    i, j = steps.i[nodes], steps.j[nodes]
    is_midpoint = (i % step == 0) & (j % step == 0) & ((i % (2 * step) != 0) | (j % (2 * step) != 0))
    nodes, i, j = nodes[is_midpoint], i[is_midpoint], j[is_midpoint]
    along, across = np.where(i % (2 * step) != 0, step, 0), np.where(j % (2 * step) != 0, step, 0)
    across = np.where((along > 0) & (across > 0), -across, across)  # the diagonal goes the other way
    grid_start, rows = first.ravel()[steps.grid[nodes]].astype(np.int64), steps.rows[nodes]
    end_a, end_b = (grid_start + node_index(rows, i + sign * along, j + sign * across) for sign in (-1, 1))
    return nodes, end_a, end_b
