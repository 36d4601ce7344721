"""Which gather cell a point on a surface belongs to: a kd-tree over positions and normals, one for each side of a mesh.

A side of a mesh is a tree of its own, and directions that differ much are told apart before places are, so that no cell
reaches through a thin wall or round an edge. Cells are numbered in the order of the tree: neighbours have near numbers,
which is what a Haar transform over them compresses.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.trace.packet import LANES

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

NO_CELL = 65_535  # of 16-bit links
MAX_CELLS = 65_535
NO_CELL_NODE = np.int32(-1 - NO_CELL)  # a leaf, like those of cells
_BENT = np.float32(0.5)  # extent of a normal's component over a cell, from which on the cell is divided by it


class CellTree(NamedTuple):
    """Inner nodes, and where the trees of the sides begin.

    Attributes:
        axis: 0 to 2 for a position's component, 3 to 5 for a normal's. (n,) uint8
        value: points below go to the first child, the others to the second. (n,) float32
        children: nodes; −1 − c for cell c. (n, 2) int32
        roots: of side s of mesh m at 2 m + s, s = 1 where triangles are seen from behind. (2 meshes,) int32
    """

    axis: NDArray[np.uint8]
    value: F32
    children: I32
    roots: I32


@nb.njit(nogil=True, cache=True)
def locate(tree, keys, nodes):  # type: ignore[no-untyped-def]
    """Locate the cells of `LANES` points; all go down the tree together, so that none waits for memory alone.

    Args:
        tree: a `CellTree`.
        keys: position and normal of each. (6, `LANES`) float32
        nodes: the tree's root on each one's side; becomes its cell, `NO_CELL` where there is none. (`LANES`,) int32
    """
    axes, values, children = tree.axis, tree.value, tree.children
    num_inner = LANES
    while num_inner > 0:
        num_inner = 0
        for k in range(LANES):
            node = nodes[k]
            if node >= 0:
                nodes[k] = children[node, int(keys[axes[node], k] >= values[node])]
                num_inner += 1
    for k in range(LANES):
        nodes[k] = -1 - nodes[k]


@nb.njit(nogil=True, cache=True)
def _gap(along):  # type: ignore[no-untyped-def]
    """Count the sorted values below a gap that is as near as possible to their middle.

    Points of one plane differ by rounding, and their light comes from beside it: a plane between points that lie
    together would put hits on the wrong side of it, so that gaps are no smaller than a quarter of the mean one.
    """
    num = along.shape[0]
    least = np.float32(0.25) * (along[num - 1] - along[0]) / num
    for away in range(num):
        for below in (num // 2 - away, num // 2 + away):
            if 0 < below < num and along[below] - along[below - 1] > least:
                return below
    return int(np.argmax(along[1:] - along[:-1])) + 1


@nb.njit(nogil=True, cache=True)
def _split(keys, rows):  # type: ignore[no-untyped-def]
    """Sort rows along the axis to divide them by.

    Returns:
        The axis, −1 where all rows are the same point; how many rows go to the first child, and the value between.
    """
    low, high = keys[rows[0]].copy(), keys[rows[0]].copy()
    for row in rows:
        for axis in range(6):
            low[axis] = min(low[axis], keys[row, axis])
            high[axis] = max(high[axis], keys[row, axis])
    extent = high - low
    bent = 3 + np.argmax(extent[3:])
    axis = int(bent if extent[bent] > _BENT else np.argmax(extent[:3]))
    if extent[axis] <= 0:
        return -1, 0, np.float32(0)
    along = keys[rows, axis]
    order = np.argsort(along, kind="mergesort")
    rows[:] = rows[order]
    along = along[order]
    # directions fall into heaps, of which none is cut; places are divided evenly
    first = np.searchsorted(along, np.float32(0.5) * (low[axis] + high[axis])) if axis >= 3 else _gap(along)
    value = np.float32(0.5) * (along[first - 1] + along[first])
    if value <= along[first - 1]:  # they are one rounding apart
        value = along[first]
    return axis, first, value


@nb.njit(nogil=True, cache=True)
def _grow(keys, rows, num_leaves, first_node, first_leaf, axes, values, children, begins):  # type: ignore[no-untyped-def]
    """Divide rows into at most `num_leaves` leaves, as evenly as they come.

    Writes nodes from `first_node` and the beginnings of leaves within rows from `first_leaf` on.
    Returns the root, and the numbers of nodes and leaves so far.
    """
    node, leaf = first_node, first_leaf
    # start, stop, leaves, parent, which child
    stack = [(0, rows.shape[0], num_leaves, -1, 0)]
    root = np.int64(0)
    while stack:
        start, stop, leaves, parent, child = stack.pop()
        axis, first, value = -1, 0, np.float32(0)
        if leaves > 1:
            axis, first, value = _split(keys, rows[start:stop])
        if axis < 0:
            here = -1 - leaf
            begins[leaf] = start
            leaf += 1
        else:
            here = node
            axes[node], values[node] = axis, value
            node += 1
            count = stop - start
            left = min(max(1, int(np.round(leaves * first / count))), leaves - 1)
            stack.append((start + first, stop, leaves - left, here, 1))
            stack.append((start, start + first, left, here, 0))
        if parent < 0:
            root = here
        else:
            children[parent, child] = here
    return root, node, leaf


def grow_tree(keys: F32, side: I32, num_sides: int, num_cells: int) -> tuple[CellTree, list[NDArray[np.int64]]]:
    """Divide points into cells of about the same number of them.

    Args:
        keys: position and unit normal. (n, 6) float32. side: number of each point's, in [0, num_sides). (n,) int32
        num_sides: twice the number of meshes.
        num_cells: at most `MAX_CELLS`; somewhat fewer where points coincide, or more so that each side has one.
    Returns:
        The tree, and the points of each cell.
    """
    roots = np.full(num_sides, NO_CELL_NODE, np.int32)
    sides, counts = np.unique(side, return_counts=True)
    shares = np.maximum(1, np.minimum(counts, num_cells * counts // max(1, len(side)))).astype(np.int64)
    total = int(shares.sum())
    axes, values = np.empty(total, np.uint8), np.empty(total, np.float32)
    children, begins = np.empty((total, 2), np.int32), np.empty(total, np.int64)
    node = leaf = 0
    cells: list[NDArray[np.int64]] = []
    for which, share in zip(sides, shares, strict=True):
        rows, first = np.nonzero(side == which)[0], leaf
        roots[which], node, leaf = _grow(keys, rows, int(share), node, leaf, axes, values, children, begins)
        cells += np.split(rows, begins[first + 1 : leaf])
    return CellTree(axes[:node], values[:node], children[:node], roots), cells
