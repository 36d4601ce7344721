"""Kernels of a term with all curves contracted: light triangles weighted by the averages of its curves.

The average of a curve over a triangle is approximated by that over a box (`relume.transport.shading.table_averages`).
Triangles for which this is too inaccurate are divided, if they matter at the point.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.transport.shading.light_list_kernel import (
    allocate_chunks,
    band_scales,
    defer_triangles,
    error_tolerance,
    evaluate_listed,
    per_axis,
)
from relume.transport.shading.table_averages import CHUNK, evaluate, load_nodes, rotate_nodes, sum_up

_ONE, _HALF, _QUARTER = np.float32(1), np.float32(0.5), np.float32(0.25)
# corners of the four children among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_MAX_DEPTH = 6


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
def _add_divided(curves, scale, wo, no_group_range, num, tolerance, generations, division_scratch, scratch, total):  # type: ignore[no-untyped-def]
    """Add divided triangles: the first `num` of the first generation, and recursively their children.

    Args:
        curves, scale, wo, scratch: as in `evaluate`. no_group_range: its group_range, empty.
        tolerance: as in `defer_triangles`.
        generations: local, weight, radius, indices, value and error of each, written except for the first three of the
            first.
        division_scratch: scratch for parents, and for the number of triangles and of finished ones per generation, see
            `shade_points`.
        total: added to. (3,)
    """
    local, weight, radius, deferred, value, error = generations
    parent, count, done = division_scratch
    for n in range(num):
        deferred[0, n] = n
    level, count[0], done[0] = 0, num, 0
    while level >= 0:
        if done[level] == count[level]:
            level -= 1
            continue
        batch = deferred[level, done[level] : min(done[level] + CHUNK // 4, count[level])]
        done[level] += len(batch)
        child_level = level + 1
        num_children = _divide(
            local[level],
            weight[level],
            radius[level],
            batch,
            parent,
            local[child_level],
            weight[child_level],
            radius[child_level],
        )
        evaluate(
            curves,
            scale,
            wo,
            local[child_level],
            radius[child_level],
            no_group_range,
            num_children,
            scratch,
            value[child_level],
            error[child_level],
        )
        done[child_level] = count[child_level] = 0
        if child_level < _MAX_DEPTH:
            count[child_level] = defer_triangles(
                value[child_level],
                weight[child_level],
                error[child_level],
                num_children,
                tolerance,
                deferred[child_level],
            )
        sum_up(value[child_level], weight[child_level], num_children, total)
        level = child_level


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def shade_points(  # type: ignore[no-untyped-def]
    normal, tangent, first, light, shading, local_wo, nodes, irradiance_radius, axes, curves, start, stop, out
):
    """Add the contributions of the listed lights to points [start, stop).

    Args:
        normal, tangent, first, light, shading, local_wo, start, stop: as in `project_points`.
        nodes: nodes of the lights. (M, 6, 3) float32 irradiance_radius: their irradiance and, in radians, radius. (M,
            4) float32
        axes: `Curve.axes` of each. (C, 3) float32
        curves: see `evaluate`.
        out: added to; its content counts as part of a point's light. (points, 3, ≥ 1) float32
    """
    num_curves, (scale, num_rows) = axes.shape[0], band_scales(curves)
    # allocated here: a constant is not writable and would compile its users once more
    wo, total, no_group_range = np.empty((num_curves, 3), np.float32), np.empty(3, np.float32), np.empty(0, np.float32)
    chunks, child_arrays = (
        allocate_chunks(nodes.shape[0] // CHUNK + 1, num_rows),
        allocate_chunks(_MAX_DEPTH + 1, num_rows),
    )
    local, scratch = np.empty((_MAX_DEPTH + 1, 3, 6, CHUNK), np.float32), np.empty((11, CHUNK), np.float32)
    count, done = np.empty(_MAX_DEPTH + 1, np.int64), np.empty(_MAX_DEPTH + 1, np.int64)
    division_scratch = (np.empty((22, CHUNK // 4), np.float32), count, done)
    _shade(
        normal, tangent, (first, light, shading), local_wo, (nodes, irradiance_radius, no_group_range), axes, (curves,
        scale), start, stop,
        (wo, total, np.empty(CHUNK, np.int32), chunks, (local, *child_arrays), division_scratch, scratch), out,
    )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _shade(normal, tangent, entries, local_wo, lights, axes, curves, start, stop, scratch_arrays, out):  # type: ignore[no-untyped-def]
    """Implement `shade_points` in the memory that it allocates."""
    (first, light, shading), (nodes, _, no_group_range), (curves, scale) = entries, lights, curves
    wo, total, deferred_lights, chunks, generations, division_scratch, scratch = scratch_arrays
    weight, reach, deferred, value, error = chunks
    local, child_arrays = generations[0], generations[1:]
    for p in range(start, stop):
        begin, end = first[p - start], first[p - start + 1]
        if begin == end:
            continue
        per_axis(axes, local_wo, begin, wo)
        total[:] = 0
        evaluate_listed(
            normal[p], tangent[p], (light, shading), begin, end, lights, curves, scale, wo, local[0], scratch,
            no_group_range,
            chunks, total,
        )  # fmt: skip
        row = out[p - start, :, 0]
        if axes.shape[0] == 0:
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
            _copy(light[at : at + num], entries, deferred_lights)
            _copy(reach[chunk], entries, child_arrays[1][0])
            for channel in range(3):
                _copy(weight[chunk, channel], entries, child_arrays[0][0, channel])
            for node in range(6):
                load_nodes(
                    nodes, node, deferred_lights, 0, divided, local[0, 0, node], local[0, 1, node], local[0, 2, node]
                )
            rotate_nodes(normal[p], tangent[p], 0, divided, local[0])
            _add_divided(
                curves, scale, wo, no_group_range, divided, tolerance, generations, division_scratch, scratch, total
            )
        _add_to(row, total)
