"""Kernels that evaluate a point's listed lights or groups, and find those that are not accurate enough."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.transport.shading.table_averages import CHUNK, evaluate, load_midpoints, load_weights, rotate_nodes, sum_up

_ZERO, _ONE = np.float32(0), np.float32(1)
# A triangle is too inaccurate if its error exceeds both: a fraction of its own contribution, and of all light.
_TOLERANCE, _TOLERANCE_OF_ALL = np.float32(0.02), np.float32(1e-3)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def band_scales(curves):  # type: ignore[no-untyped-def]
    """Return the bands per radian of each curve, and the number of rows of their product. curves: see `evaluate`."""
    _, _, num_rows, num_bands = curves
    scale, max_rows = np.empty(num_bands.shape[0], np.float32), 1
    for k in range(num_bands.shape[0]):
        scale[k], max_rows = num_bands[k] / (np.pi / 2), max(max_rows, num_rows[k])
    return scale, max_rows


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def per_axis(axes, local_wo, entry, out):  # type: ignore[no-untyped-def]
    """Multiply wo by the axes of each curve.

    Args:
        axes: axes of the curves. (C, 3). local_wo: local view direction of all entries. (3, entries). entry: its index.
        out: written. (C, 3)
    """
    for k in range(axes.shape[0]):
        for axis in range(3):
            out[k, axis] = axes[k, axis] * local_wo[axis, entry]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def allocate_chunks(num, num_rows):  # type: ignore[no-untyped-def]
    """Allocate `num` chunks of triangles: weight, radius, deferred indices, value, error."""
    weight, radius = np.empty((num, 3, CHUNK), np.float32), np.empty((num, CHUNK), np.float32)
    value, error = np.empty((num, num_rows, CHUNK), np.float32), np.empty((num, CHUNK), np.float32)
    return weight, radius, np.empty((num, CHUNK + 1), np.int64), value, error


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def evaluate_listed(  # type: ignore[no-untyped-def]
    n, t, light_list, begin, end, lights, curves, scale, wo, local, scratch, chunk_range, chunks, total
):
    """Evaluate a point's listed lights [begin, end), chunk by chunk.

    Args:
        n, t: normal and tangent of the point. light_list: light and shading of its list.
        lights: nodes and irradiance_radius, see `shade_points`, and group_range, see `evaluate`, of all lights.
        curves, scale, wo, scratch: as in `evaluate`. local: local of one chunk, written.
        chunk_range: scratch for the group_range of a chunk; unused if that is empty. (CHUNK,)
        chunks: from `allocate_chunks`, written except for the deferred indices. total: added to. (3,)
    """
    light, shading = light_list
    nodes, irradiance_radius, group_range = lights
    weight, reach, _, value, error = chunks
    for chunk in range((end - begin + CHUNK - 1) // CHUNK):
        at = begin + chunk * CHUNK
        num = min(CHUNK, end - at)
        if scale.shape[0] > 0:
            load_midpoints(nodes, light, at, num, local)
            rotate_nodes(n, t, 3, num, local)
        load_weights(irradiance_radius, light, shading, at, num, weight[chunk], reach[chunk])
        if group_range.shape[0] > 0:
            for k in range(num):
                chunk_range[k] = group_range[light[at + k]]
        evaluate(curves, scale, wo, local, reach[chunk], chunk_range, num, scratch, value[chunk], error[chunk])
        sum_up(value[chunk], weight[chunk], num, total)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def error_tolerance(total, row):  # type: ignore[no-untyped-def]
    """Return the tolerated error given all light of a point. total: (3,) row: light it has already. (3,)"""
    return _TOLERANCE_OF_ALL * (total[0] + total[1] + total[2] + abs(row[0]) + abs(row[1]) + abs(row[2]))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def defer_triangles(value, weight, error, num, tolerance, deferred):  # type: ignore[no-untyped-def]
    """List the triangles that are not accurate enough and set their values to zero; return their number.

    Args:
        value, weight, error: from `evaluate` and `load_weights`; errors are overwritten. tolerance: tolerated error.
        deferred: indices, written. (> num,)
    """
    blue_row = value.shape[0] - 1
    red, green, blue = value[0], value[blue_row // 2], value[blue_row]
    for n in range(num):
        contribution = weight[0, n] * red[n] + weight[1, n] * green[n] + weight[2, n] * blue[n]
        error[n] = _ONE if (error[n] > _TOLERANCE) & (error[n] * contribution > tolerance) else _ZERO
    count = 0
    for n in range(num):
        deferred[count] = n
        count += int(error[n])
    for row in range(blue_row + 1):
        row_values = value[row]
        for n in range(num):
            row_values[n] *= _ONE - error[n]
    return count
