"""Lookup of the patch at a surface point: a kd-tree over positions and normals, one for each side of a mesh.

Each side of a mesh has its own tree, and very different normals are split before positions, so that no patch reaches
through a thin wall or around an edge. Patches are numbered in tree order: neighbors have similar indices, which a Haar
transform over the indices compresses.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.raytrace.ray_packet import LANES

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

NO_PATCH = 65_535  # in 16-bit gather hits
MAX_PATCHES = 65_535
NO_PATCH_NODE = np.int32(-1 - NO_PATCH)  # a leaf without a patch
# a patch whose normals vary more in a component is split along it
_MAX_NORMAL_EXTENT = np.float32(0.5)


class PatchTree(NamedTuple):
    """Inner nodes of the trees, and their roots.

    Attributes:
        axis: 0 to 2 for a position component, 3 to 5 for a normal component.
        value: split value; smaller keys are in the first child, others in the second.
        children: nodes; −1 − c for patch c.
        roots: root nodes of side s of mesh m at 2 m + s, with s = 1 for the back side.
    """

    axis: Shaped[NDArray[np.uint8], " n"]
    value: Shaped[F32, " n"]
    children: Shaped[I32, "n 2"]
    roots: Shaped[I32, " sides"]


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def locate(tree, keys, nodes):  # type: ignore[no-untyped-def]
    """Find the patches of `LANES` points; interleaves the lookups to hide memory latency.

    Args:
        tree: a `PatchTree`.
        keys: position and normal of each point. (6, `LANES`) float32
        nodes: root of each point's side; replaced by its patch, `NO_PATCH` if there is none. (`LANES`,) int32
    """
    axes, values, children = tree.axis, tree.value, tree.children
    num_unfinished = LANES
    while num_unfinished > 0:
        num_unfinished = 0
        for k in range(LANES):
            node = nodes[k]
            if node >= 0:
                nodes[k] = children[node, int(keys[axes[node], k] >= values[node])]
                num_unfinished += 1
    for k in range(LANES):
        nodes[k] = -1 - nodes[k]


@nb.njit(nogil=True, cache=True)
def _find_gap(values):  # type: ignore[no-untyped-def]
    """Count the sorted values below a gap near their middle.

    Points of one plane differ by rounding: a split between such points would assign hits to the wrong side. Gaps
    are therefore at least a quarter of the mean gap.
    """
    num = values.shape[0]
    min_gap = np.float32(0.25) * (values[num - 1] - values[0]) / num
    for offset in range(num):
        for below in (num // 2 - offset, num // 2 + offset):
            if 0 < below < num and values[below] - values[below - 1] > min_gap:
                return below
    return int(np.argmax(values[1:] - values[:-1])) + 1


@nb.njit(nogil=True, cache=True)
def _split(keys, reach, rows):  # type: ignore[no-untyped-def]
    """Sort the points of a leaf along the axis to split, in place.

    Returns:
        The axis, −1 if all rows are the same point; number of rows in the first child, and the split value.
    """
    low, high = keys[0].copy(), keys[0].copy()
    for row in range(1, len(keys)):
        for axis in range(6):
            low[axis] = min(low[axis], keys[row, axis])
            high[axis] = max(high[axis], keys[row, axis])
    extent = high - low
    normal_axis = 3 + np.argmax(extent[3:])
    axis = int(normal_axis if extent[normal_axis] > _MAX_NORMAL_EXTENT else np.argmax(extent[:3]))
    if extent[axis] <= 0:
        return -1, 0, np.float32(0)
    order = np.argsort(keys[:, axis].copy(), kind="mergesort")
    sorted_rows, sorted_keys, sorted_reach = rows[order], keys[order], reach[order]
    for row in range(len(rows)):
        rows[row], reach[row] = sorted_rows[row], sorted_reach[row]
        for k in range(6):
            keys[row, k] = sorted_keys[row, k]
    values = keys[:, axis]
    # normals form clusters, which are not cut; positions are split evenly
    num_first = np.searchsorted(values, np.float32(0.5) * (low[axis] + high[axis])) if axis >= 3 else _find_gap(values)
    value = np.float32(0.5) * (values[num_first - 1] + values[num_first])
    if value <= values[num_first - 1]:  # adjacent floats
        value = values[num_first]
    return axis, num_first, value


@nb.njit(nogil=True, cache=True)
def _light_variation(keys, reach):  # type: ignore[no-untyped-def]
    """Estimate the variation of light on a patch, times its points: q / (1 + q), q = Var(x) / R² + Var(n).

    Light changes with position by at most about 1 / R and with the normal by about 1. R is the harmonic mean distance
    of visible surfaces (the split sphere of Ward 1988); lobes resolve surfaces by their width.

    Args:
        keys, reach: as in `grow_tree`, of the points of the patch.
    """
    mean, mean_inverse_reach = np.zeros(6), 0.0
    for row in range(len(keys)):
        mean_inverse_reach += 1 / max(reach[row], np.float32(1e-12))
        for axis in range(6):
            mean[axis] += keys[row, axis]
    mean /= len(keys)
    mean_inverse_reach /= len(keys)
    position_variance = normal_variance = 0.0
    for row in range(len(keys)):
        for axis in range(3):
            position_variance += (keys[row, axis] - mean[axis]) ** 2
            normal_variance += (keys[row, 3 + axis] - mean[3 + axis]) ** 2
    variation = (position_variance * mean_inverse_reach * mean_inverse_reach + normal_variance) / len(keys)
    return len(keys) * variation / (1 + variation)


@nb.njit(nogil=True, cache=True)
def _grow_nodes(keys, reach, rows, root_starts, max_leaves):  # type: ignore[no-untyped-def]
    """Split rows into at most `max_leaves` leaves, always the one with the largest variation of light.

    Args:
        keys, reach, rows: as in `grow_tree`, and the number of each point; grouped by root, sorted in place so that
            those of each leaf are contiguous.
        root_starts: begin of each root's rows, and the end. (roots + 1,) int64
    Returns:
        Axes, values and children of nodes; per leaf the begin of its rows, its parent (−1 − root if it is a root
        itself) and its child index; the node of each root, if it has one.
    """
    num_roots = len(root_starts) - 1
    axes, values = np.empty(max_leaves, np.uint8), np.empty(max_leaves, np.float32)
    children, roots = np.empty((max_leaves, 2), np.int32), np.full(num_roots, -1, np.int32)
    leaves = np.empty((max(max_leaves, num_roots), 3), np.int64)
    queue = [(0.0, 0, 0, 0, 0) for _ in range(0)]
    for root in range(num_roots):
        start, stop = root_starts[root], root_starts[root + 1]
        heapq.heappush(queue, (-_light_variation(keys[start:stop], reach[start:stop]), start, stop, -1 - root, 0))
    node, num_leaves = 0, 0
    while queue:
        _, start, stop, parent, child = heapq.heappop(queue)
        axis, num_first, value = -1, 0, np.float32(0)
        if num_leaves + len(queue) + 1 < max_leaves:
            axis, num_first, value = _split(keys[start:stop], reach[start:stop], rows[start:stop])
        if axis < 0:
            leaves[num_leaves, 0], leaves[num_leaves, 1], leaves[num_leaves, 2] = start, parent, child
            num_leaves += 1
            continue
        axes[node], values[node] = axis, value
        if parent < 0:
            roots[-1 - parent] = node
        else:
            children[parent, child] = node
        for child_side, (low, high) in enumerate(((start, start + num_first), (start + num_first, stop))):
            heapq.heappush(queue, (-_light_variation(keys[low:high], reach[low:high]), low, high, node, child_side))
        node += 1
    return axes[:node], values[:node], children[:node], leaves[:num_leaves], roots


def grow_tree(
    keys: Shaped[F32, "n 6"], reach: Shaped[F32, " n"], side: Shaped[I32, " n"], num_sides: int, max_patches: int
) -> tuple[PatchTree, list[NDArray[np.int64]]]:
    """Divide points into patches of about equal variation of light times number of points.

    Args:
        keys: position and unit normal.
        reach: width of the footprint at each point, below which a ray does not resolve positions.
        side: side of each point, in [0, num_sides). num_sides: twice the number of meshes.
        max_patches: at most `MAX_PATCHES`; fewer if points coincide, or more so that each side has one.
    Returns:
        The tree, and the points of each patch.
    """
    rows = np.argsort(side, kind="stable")
    sides, root_starts = np.unique(side[rows], return_index=True)
    bounds = np.append(root_starts, len(rows)).astype(np.int64)
    axes, values, children, leaves, root_nodes = _grow_nodes(keys[rows], reach[rows], rows, bounds, max_patches)
    order = np.argsort(leaves[:, 0])
    starts, parents, child_side = leaves[order].T
    roots, leaf_codes = np.full(num_sides, NO_PATCH_NODE, np.int32), -1 - np.arange(len(order), dtype=np.int32)
    roots[sides] = root_nodes
    has_parent = parents >= 0
    children[parents[has_parent], child_side[has_parent]] = leaf_codes[has_parent]
    roots[sides[-1 - parents[~has_parent]]] = leaf_codes[~has_parent]
    return PatchTree(axes, values, children, roots), np.split(rows, starts[1:]) if len(order) else []
