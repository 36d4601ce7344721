"""The kernels of a term with all its curves contracted: light triangles weighed by the means of its curves.

A curve's mean over a triangle is that over a box (`relume.project.shading.boxes`). Triangles over which that would not
do are divided, where they matter to the point at all.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.project.shading.boxes import CHUNK, evaluate, look_up, sum_up, turn
from relume.project.shading.listed import by_axes, evaluate_listed, least_of, room, scales_of, set_aside
from relume.uncounted import UNCOUNTED

_ONE, _HALF, _QUARTER = np.float32(1), np.float32(0.5), np.float32(0.25)
# corners of the four children among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_MAX_DEPTH = 6


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _copy(source, which, target):  # type: ignore[no-untyped-def]
    for n in range(which.shape[0]):
        target[n] = source[which[n]]


@nb.njit(nogil=True, cache=True, forceinline=True, **UNCOUNTED)
def _add_to(row, total):  # type: ignore[no-untyped-def]
    for channel in range(3):
        row[channel] += total[channel]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _divide(local, weight, radius, which, parent, to_local, to_weight, to_radius):  # type: ignore[no-untyped-def]
    """Make the four children of the listed triangles; returns their number.

    Args:
        local, weight, radius: of a generation, as in `evaluate` and `weigh`. which: the listed. (n,)
        parent: scratch. (22, ≥ n) to_local, to_weight, to_radius: of the children, written.
    """
    count = which.shape[0]
    for node in range(6):
        for axis in range(3):
            _copy(local[axis, node], which, parent[3 * node + axis])
    for channel in range(3):
        _copy(weight[channel], which, parent[18 + channel])
    _copy(radius, which, parent[21])
    for child in range(4):
        begin = child * count
        for corner in range(3):
            first = 3 * _CHILDREN[child, corner]
            for axis in range(3):
                of_parent, to = parent[first + axis], to_local[axis, corner]
                for n in range(count):
                    to[begin + n] = of_parent[n]
        for n in range(count):
            to_weight[0, begin + n] = _QUARTER * parent[18, n]
            to_weight[1, begin + n] = _QUARTER * parent[19, n]
            to_weight[2, begin + n] = _QUARTER * parent[20, n]
            to_radius[begin + n] = _HALF * parent[21, n]
    for edge in range(3):
        following = (edge + 1) % 3
        for axis in range(3):
            a, b, middle = to_local[axis, edge], to_local[axis, following], to_local[axis, 3 + edge]
            for n in range(4 * count):
                middle[n] = a[n] + b[n]
        x, y, z = to_local[0, 3 + edge], to_local[1, 3 + edge], to_local[2, 3 + edge]
        for n in range(4 * count):
            inverse = _ONE / math.sqrt(x[n] * x[n] + y[n] * y[n] + z[n] * z[n])
            x[n], y[n], z[n] = x[n] * inverse, y[n] * inverse, z[n] * inverse
    return 4 * count


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _add_divided(curves, scale, wo, alone, num, least, generations, family, scratch, total):  # type: ignore[no-untyped-def]
    """Add triangles that are divided: the first `num` of the first generation, and what comes of them.

    Args:
        curves, scale, wo, scratch: as in `evaluate`. alone: its `between` of what is no group.
        least: as in `set_aside`.
        generations: local, weight, radius, which, value and error of each, written but for the first's first three.
        family: scratch for parents, and for how many of each generation there are, and are done, see `shade_points`.
        total: added to. (3,)
    """
    local, weight, radius, which, value, error = generations
    parent, count, done = family
    for n in range(num):
        which[0, n] = n
    level, count[0], done[0] = 0, num, 0
    while level >= 0:
        if done[level] == count[level]:
            level -= 1
            continue
        listed = which[level, done[level] : min(done[level] + CHUNK // 4, count[level])]
        done[level] += len(listed)
        to = level + 1
        parts = _divide(local[level], weight[level], radius[level], listed, parent, local[to], weight[to], radius[to])
        evaluate(curves, scale, wo, local[to], radius[to], alone, parts, scratch, value[to], error[to])
        done[to] = count[to] = 0
        if to < _MAX_DEPTH:
            count[to] = set_aside(value[to], weight[to], error[to], parts, least, which[to])
        sum_up(value[to], weight[to], parts, total)
        level = to


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def shade_points(  # type: ignore[no-untyped-def]
    normal, tangent, first, light, shading, local_wo, nodes, brings, axes, curves, start, stop, out
):
    """Add what the listed lights bring to points [start, stop).

    Args:
        normal, tangent, first, light, shading, local_wo, start, stop: as in `project_points`.
        nodes: of the lights. (M, 6, 3) float32 brings: their irradiance and, in radians, radius. (M, 4) float32
        axes: `Curve.axes` of each. (C, 3) float32
        curves: see `evaluate`.
        out: added to; what is there is part of what a point receives. (points, 3, ≥ 1) float32
    """
    num_curves, (scale, num_rows) = axes.shape[0], scales_of(curves)
    # made here: a constant could not be written, and what it is handed to would be compiled once more for that
    wo, total, alone = np.empty((num_curves, 3), np.float32), np.empty(3, np.float32), np.empty(0, np.float32)
    chunks, of_parts = room(nodes.shape[0] // CHUNK + 1, num_rows), room(_MAX_DEPTH + 1, num_rows)
    local, scratch = np.empty((_MAX_DEPTH + 1, 3, 6, CHUNK), np.float32), np.empty((11, CHUNK), np.float32)
    count, done = np.empty(_MAX_DEPTH + 1, np.int64), np.empty(_MAX_DEPTH + 1, np.int64)
    family = (np.empty((22, CHUNK // 4), np.float32), count, done)
    _shade(
        normal, tangent, (first, light, shading), local_wo, (nodes, brings, alone), axes, (curves, scale), start, stop,
        (wo, total, np.empty(CHUNK, np.int32), chunks, (local, *of_parts), family, scratch), out,
    )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _shade(normal, tangent, listed, local_wo, lights, axes, curves, start, stop, memory, out):  # type: ignore[no-untyped-def]
    """Do what `shade_points` is for, in the memory that it has made."""
    (first, light, shading), (nodes, _, alone), (curves, scale) = listed, lights, curves
    wo, total, chosen, chunks, generations, family, scratch = memory
    weight, reach, which, value, error = chunks
    local, of_parts = generations[0], generations[1:]
    for p in range(start, stop):
        begin, end = first[p - start], first[p - start + 1]
        if begin == end:
            continue
        by_axes(axes, local_wo, begin, wo)
        total[:] = 0
        evaluate_listed(
            normal[p], tangent[p], (light, shading), begin, end, lights, curves, scale, wo, local[0], scratch, alone,
            chunks, total,
        )  # fmt: skip
        row = out[p - start, :, 0]
        if axes.shape[0] == 0:
            _add_to(row, total)
            continue
        least = least_of(total, row)  # what is there already counts as well
        total[:] = 0
        for chunk in range((end - begin + CHUNK - 1) // CHUNK):
            at = begin + chunk * CHUNK
            num = min(CHUNK, end - at)
            divided = set_aside(value[chunk], weight[chunk], error[chunk], num, least, which[chunk])
            sum_up(value[chunk], weight[chunk], num, total)
            if divided == 0:
                continue
            listed = which[chunk, :divided]
            _copy(light[at : at + num], listed, chosen)
            _copy(reach[chunk], listed, of_parts[1][0])
            for channel in range(3):
                _copy(weight[chunk, channel], listed, of_parts[0][0, channel])
            for node in range(6):
                look_up(nodes, node, chosen, 0, divided, local[0, 0, node], local[0, 1, node], local[0, 2, node])
            turn(normal[p], tangent[p], 0, divided, local[0])
            _add_divided(curves, scale, wo, alone, divided, least, generations, family, scratch, total)
        _add_to(row, total)
