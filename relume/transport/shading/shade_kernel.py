"""Kernels of a term with all curves contracted: light triangles weighted by the averages of its curves.

The average of a curve over a triangle is approximated by that over a box (`relume.transport.shading.table_averages`).
Triangles for which this is too inaccurate are divided, if they matter at the point.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.transport.shading.light_list_kernel import (
    Chunks,
    allocate_chunks,
    defer_triangles,
    error_tolerance,
    evaluate_listed,
)
from relume.transport.shading.table_averages import CHUNK, evaluate, load_nodes, rotate_nodes, sum_up

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

_ONE, _HALF, _QUARTER = np.float32(1), np.float32(0.5), np.float32(0.25)
# corners of the four children among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_MAX_DEPTH = 6


class DivisionScratch(NamedTuple):
    """Scratch memory for dividing triangles: one chunk per generation.

    Attributes:
        local: nodes in the frame of the point. generations: as of listed lights. lights: divided ones of a chunk.
        num, done: triangles to divide per generation, and how many of them are done. parent: for `_divide`.
    """

    local: Shaped[F32, "generations 3 6 CHUNK"]
    generations: Chunks
    lights: Shaped[NDArray[np.int32], " CHUNK"]
    num: Shaped[I64, " generations"]
    done: Shaped[I64, " generations"]
    parent: Shaped[F32, "22 CHUNK/4"]


def allocate_division(num_rows: int) -> DivisionScratch:
    """Allocate scratch memory. num_rows: of the product of the curves, 1 or 3."""
    local, lights = np.empty((_MAX_DEPTH + 1, 3, 6, CHUNK), np.float32), np.empty(CHUNK, np.int32)
    count, done = np.empty((2, _MAX_DEPTH + 1), np.int64)
    parent = np.empty((22, CHUNK // 4), np.float32)
    return DivisionScratch(local, allocate_chunks(_MAX_DEPTH + 1, num_rows), lights, count, done, parent)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _copy(source, indices, target):  # type: ignore[no-untyped-def]
    for n in range(indices.shape[0]):
        target[n] = source[indices[n]]


@nb.njit(nogil=True, cache=True, forceinline=True, **NO_REFCOUNT)
def _add_to(row, total):  # type: ignore[no-untyped-def]
    for channel in range(3):
        row[channel] += total[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _divide(local, weight, radius, indices, parent, to_local, to_weight, to_radius):  # type: ignore[no-untyped-def]
    """Create the four children of the listed triangles; return their number.

    Args:
        local, weight, radius: arrays of a generation, as in `evaluate` and `load_weights`.
        indices: the listed. (n,)
        parent: scratch. (22, ≥ n) to_local, to_weight, to_radius: arrays of the children, written.
    """
    count = indices.shape[0]
    for node in range(6):
        for axis in range(3):
            _copy(local[axis, node], indices, parent[3 * node + axis])
    for channel in range(3):
        _copy(weight[channel], indices, parent[18 + channel])
    _copy(radius, indices, parent[21])
    for child in range(4):
        begin = child * count
        for corner in range(3):
            first = 3 * _CHILDREN[child, corner]
            for axis in range(3):
                parent_values, child_values = parent[first + axis], to_local[axis, corner]
                for n in range(count):
                    child_values[begin + n] = parent_values[n]
        for n in range(count):
            to_weight[0, begin + n] = _QUARTER * parent[18, n]
            to_weight[1, begin + n] = _QUARTER * parent[19, n]
            to_weight[2, begin + n] = _QUARTER * parent[20, n]
            to_radius[begin + n] = _HALF * parent[21, n]
    for edge in range(3):
        next_edge = (edge + 1) % 3
        for axis in range(3):
            a, b, middle = to_local[axis, edge], to_local[axis, next_edge], to_local[axis, 3 + edge]
            for n in range(4 * count):
                middle[n] = a[n] + b[n]
        x, y, z = to_local[0, 3 + edge], to_local[1, 3 + edge], to_local[2, 3 + edge]
        for n in range(4 * count):
            inverse = _ONE / math.sqrt(x[n] * x[n] + y[n] * y[n] + z[n] * z[n])
            x[n], y[n], z[n] = x[n] * inverse, y[n] * inverse, z[n] * inverse
    return 4 * count


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_divided(curves, num, tolerance, scratch, division):  # type: ignore[no-untyped-def]
    """Add divided triangles to the total: the first `num` of the first generation, and recursively their children.

    Args:
        curves, scratch: as in `shade_points`. tolerance: as in `defer_triangles`.
        division: `DivisionScratch`, written except for the nodes, weights and radii of the first generation.
    """
    local, (weight, radius, deferred, value, error), _, count, done, parent = division
    for n in range(num):
        deferred[0, n] = n
    level, count[0], done[0] = 0, num, 0
    while level >= 0:
        if done[level] == count[level]:
            level -= 1
            continue
        batch = deferred[level, done[level] : min(done[level] + CHUNK // 4, count[level])]
        done[level] += len(batch)
        up, level = level, level + 1
        num_children = _divide(
            local[up], weight[up], radius[up], batch, parent, local[level], weight[level], radius[level]
        )
        evaluate(
            curves, scratch.wo, local[level], radius[level], scratch.between_variance, num_children, scratch.averages,
            value[level], error[level],
        )  # fmt: skip
        done[level] = count[level] = 0
        if level < _MAX_DEPTH:
            count[level] = defer_triangles(
                value[level], weight[level], error[level], num_children, tolerance, deferred[level]
            )
        sum_up(value[level], weight[level], num_children, scratch.total)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def shade_undivided(points, listed, shading, table, curves, start, stop, scratch, out):  # type: ignore[no-untyped-def]
    """Add the contributions of the listed lights to points [start, stop), and divide none. See `shade_points`."""
    for p in range(start, stop):
        begin, end = listed.first[p - start], listed.first[p - start + 1]
        if begin < end:
            n, t = points.normal[p], points.tangent[p]
            evaluate_listed(n, t, listed, shading, begin, end, table, curves, scratch)
            _add_to(out[p - start, :, 0], scratch.total)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def shade_points(points, listed, shading, table, curves, start, stop, scratch, division, out):  # type: ignore[no-untyped-def]
    """Add the contributions of the listed lights to points [start, stop).

    Args:
        points, listed, shading, start, stop: as in `project_points`. table: `TriangleTable` of the lights.
        curves: `WholeCurves`. scratch, division: `ListScratch`, `DivisionScratch`.
        out: added to; its content counts as part of a point's light. (points, 3, ≥ 1) float32
    """
    weight, radius, deferred, value, error = scratch.chunks
    local, total, lights = division.local[0], scratch.total, division.lights
    for p in range(start, stop):
        begin, end = listed.first[p - start], listed.first[p - start + 1]
        if begin == end:
            continue
        n, t, row = points.normal[p], points.tangent[p], out[p - start, :, 0]
        evaluate_listed(n, t, listed, shading, begin, end, table, curves, scratch)
        if curves.kinds.shape[0] == 0:
            _add_to(row, total)
            continue
        tolerance = error_tolerance(total, row)  # including the light already in the row
        total[:] = 0
        for chunk in range((end - begin + CHUNK - 1) // CHUNK):
            at = begin + chunk * CHUNK
            num = min(CHUNK, end - at)
            divided = defer_triangles(value[chunk], weight[chunk], error[chunk], num, tolerance, deferred[chunk])
            sum_up(value[chunk], weight[chunk], num, total)
            if divided == 0:
                continue
            entries = deferred[chunk, :divided]
            _copy(listed.light[at : at + num], entries, lights)
            _copy(radius[chunk], entries, division.generations.radius[0])
            for channel in range(3):
                _copy(weight[chunk, channel], entries, division.generations.weight[0, channel])
            for node in range(6):
                load_nodes(table.nodes, node, lights[:divided], local[0, node], local[1, node], local[2, node])
            rotate_nodes(n, t, 0, divided, local)
            _add_divided(curves, divided, tolerance, scratch, division)
        _add_to(row, total)
