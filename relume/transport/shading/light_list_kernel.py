"""Kernels that evaluate a point's listed lights or groups, and find those that are not accurate enough."""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.transport.light_culling import scale_by_axes
from relume.transport.shading.table_averages import CHUNK, evaluate, load_midpoints, load_weights, rotate_nodes, sum_up
from relume.transport.term_contraction import WholeCurves

F32 = NDArray[np.float32]

_ZERO, _ONE = np.float32(0), np.float32(1)
# A triangle is too inaccurate if its error exceeds both: a fraction of its own contribution, and of all light.
_TOLERANCE, _TOLERANCE_OF_ALL = np.float32(0.02), np.float32(1e-3)


class TriangleTable(NamedTuple):
    """Light triangles, one row each.

    Attributes:
        nodes: corners and edge midpoints. irradiance_radius: irradiance and, in radians, radius.
        between_variance: of groups, see `LightGroups`; empty for individual lights.
    """

    nodes: Shaped[F32, "M 6 3"]
    irradiance_radius: Shaped[F32, "M 4"]
    between_variance: Shaped[F32, " M_or_none"]


class Chunks(NamedTuple):
    """Memory for chunks of triangles.

    Attributes:
        weight: irradiance · q cos θi. radius: radians. deferred: indices of inaccurate ones. value, error: from
            `evaluate`.
    """

    weight: Shaped[F32, "chunks 3 CHUNK"]
    radius: Shaped[F32, "chunks CHUNK"]
    deferred: Shaped[NDArray[np.int64], "chunks CHUNK_and_one"]
    value: Shaped[F32, "chunks rows CHUNK"]
    error: Shaped[F32, "chunks CHUNK"]


class ListScratch(NamedTuple):
    """Scratch memory of a point's listed lights.

    Attributes:
        wo: local, times `Curve.axes`. total: sum of light. chunks: all lights of a point. local: nodes of one chunk.
        averages: for `evaluate`. between_variance: of one chunk.
    """

    wo: Shaped[F32, "C 3"]
    total: Shaped[F32, " 3"]
    chunks: Chunks
    local: Shaped[F32, "3 6 CHUNK"]
    averages: Shaped[F32, "11 CHUNK"]
    between_variance: Shaped[F32, " CHUNK_or_none"]


def allocate_chunks(num: int, num_rows: int) -> Chunks:
    """Allocate `num` chunks. num_rows: of the product of the curves, 1 or 3."""
    weight, value = np.empty((num, 3, CHUNK), np.float32), np.empty((num, num_rows, CHUNK), np.float32)
    radius, error = np.empty((2, num, CHUNK), np.float32)
    return Chunks(weight, radius, np.empty((num, CHUNK + 1), np.int64), value, error)


def allocate_scratch(curves: WholeCurves, max_lights: int, *, has_groups: bool = False) -> ListScratch:
    """Allocate scratch memory for points with at most `max_lights` lights or, if `has_groups`, groups."""
    chunks = allocate_chunks(max_lights // CHUNK + 1, int(curves.num_rows.max(initial=1)))
    local, averages = np.empty((3, 6, CHUNK), np.float32), np.empty((11, CHUNK), np.float32)
    wo, between_variance = np.empty_like(curves.axes), np.empty(CHUNK if has_groups else 0, np.float32)
    return ListScratch(wo, np.empty(3, np.float32), chunks, local, averages, between_variance)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def evaluate_listed(n, t, listed, shading, begin, end, table, curves, scratch):  # type: ignore[no-untyped-def]
    """Evaluate a point's listed lights [begin, end), chunk by chunk; sum them in `scratch.total`.

    Args:
        n, t: normal and tangent of the point. listed, shading, table, curves: as in `shade_points`.
        scratch: `ListScratch`, written except for the deferred indices.
    """
    weight, radius, _, value, error = scratch.chunks
    scale_by_axes(curves.axes, listed.wo, begin, scratch.wo)
    scratch.total[:] = 0
    for chunk in range((end - begin + CHUNK - 1) // CHUNK):
        at = begin + chunk * CHUNK
        num = min(CHUNK, end - at)
        light = listed.light[at : at + num]
        if curves.kinds.shape[0] > 0:
            load_midpoints(table.nodes, light, scratch.local)
            rotate_nodes(n, t, 3, num, scratch.local)
        load_weights(table.irradiance_radius, light, shading[:, at : at + num], weight[chunk], radius[chunk])
        for k in range(min(num, scratch.between_variance.shape[0])):
            scratch.between_variance[k] = table.between_variance[light[k]]
        evaluate(
            curves, scratch.wo, scratch.local, radius[chunk], scratch.between_variance, num, scratch.averages,
            value[chunk], error[chunk],
        )  # fmt: skip
        sum_up(value[chunk], weight[chunk], num, scratch.total)


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
