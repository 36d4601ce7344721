"""Kernels of the projector: angles of the listed lights, and their subdivision.

A subtriangle is a triangle over which every angle is linear: a light triangle, or a part of one near an angle's pole
(appendix A, Ben-Artzi 2006). All triangles of a level are divided together, and subtriangles are collected in arrays
and processed together, so that each loop fits the registers and fills them. Passing arrays to a helper inside a hot
loop would count references.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.angles import ALPHA, BETA, compute_alpha_beta, compute_angles
from relume.core.numba_options import NO_REFCOUNT
from relume.transport.light_culling import scale_by_axes
from relume.transport.triangle_kernel import Subtriangles, add_subtriangles, allocate_subtriangles

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

_QUARTER = np.float32(0.25)
_HALF = np.float32(0.5)
_THIRD = np.float32(1 / 3)
# An angle is treated as linear over a triangle if its error at the edge midpoints is below this tolerance, in bands,
# plus a fraction of the angle, since curves are wider away from the pole.
_TOLERANCE_BANDS = np.float32(0.04)
_TOLERANCE_FRACTION = np.float32(0.015)
_QUARTERED_BEND = np.float32(4)  # one division reduces the bend to a quarter: up to this value one is enough
_MAX_DEPTH = 6
FINE, COARSE = (np.float32(1), _MAX_DEPTH - 1), (np.float32(8), 2)
# corners of the four children among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_CULLED = np.float32(-1)
# NumPy integers, and no literals in kernel calls: a Python int would compile each kernel again
_BEGIN, _MIDDLES, _WHOLE = np.int64(0), np.int64(3), (np.int64(0), np.int64(1), np.int64(2))
_BATCH = 16  # lights divided together
# Loops are padded to a multiple of this: vectorized code and remainder loops round differently, and the result of a
# triangle must not depend on which others are culled.
_LANES = 32
_MAX_DIVIDED = _BATCH * 4 ** (_MAX_DEPTH - 1)
_MAX_SUBTRIANGLES = _BATCH * 4**_MAX_DEPTH


class Triangles(NamedTuple):
    """Triangles of a level of division; in `ProjectorScratch.divided`, two levels.

    Attributes:
        local: unit directions of corners and edge midpoints in the frame of the point. gamma: their angles, bands.
        origin: entry of the light that each is a part of.
    """

    local: Shaped[F32, "*levels 3 6 n"]
    gamma: Shaped[F32, "*levels C 6 n"]
    origin: Shaped[I64, "*levels n"]


class ProjectorScratch(NamedTuple):
    """Scratch memory of `project_points`.

    Attributes:
        wo: local, times `Curve.axes`. whole: the listed lights. divided: levels of division, written alternately.
        lists: indices of triangles that become one subtriangle, four, or are divided further. batches: the last of the
            listed lights. bend: see `_bends`. bend_sum: see `_sum_bends`.
    """

    wo: Shaped[F32, "C 3"]
    whole: Triangles
    divided: Triangles
    lists: Shaped[I64, "3 n_and_one"]
    batches: Shaped[I64, " lights"]
    bend: Shaped[F32, " n"]
    bend_sum: Shaped[F32, "C n"]
    subtriangles: Subtriangles


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _padded(num):  # type: ignore[no-untyped-def]
    """Round a number of triangles up to full vectors."""
    return (num + _LANES - 1) // _LANES * _LANES


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _relative_bend(a, b, c, ab, bc, ca):  # type: ignore[no-untyped-def]
    """Return the deviation of an angle at the edge midpoints from linear interpolation, relative to the tolerance."""
    bend = max(abs(ab - _HALF * (a + b)), max(abs(bc - _HALF * (b + c)), abs(ca - _HALF * (c + a))))
    return bend / (_TOLERANCE_BANDS + _TOLERANCE_FRACTION * min(a, min(b, c)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _rotate_nodes(n, t, nodes, light, local):  # type: ignore[no-untyped-def]
    """Rotate the nodes of listed lights into the frame of normal n and tangent t. local: (3, 6, entries), written."""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    for node in range(6):
        for entry in range(light.shape[0]):
            m = np.uint64(light[entry])
            x, y, z = nodes[0, node, m], nodes[1, node, m], nodes[2, node, m]
            local[0, node, entry] = t[0] * x + t[1] * y + t[2] * z
            local[1, node, entry] = bx * x + by * y + bz * z
            local[2, node, entry] = n[0] * x + n[1] * y + n[2] * z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _bends(gamma, support, num, bend):  # type: ignore[no-untyped-def]
    """Find the largest bend over all angles of each light, or `_CULLED` if a fixed curve is zero all over it.

    gamma: angles at the nodes, in bands. (C, 6, …). bend: (…), written.
    """
    num = _padded(num)
    bend[:num] = 0
    for k in range(gamma.shape[0]):
        a, b, c, ab, bc, ca = gamma[k, 0], gamma[k, 1], gamma[k, 2], gamma[k, 3], gamma[k, 4], gamma[k, 5]
        limit = support[k]
        for e in range(num):
            curve_bend = _relative_bend(a[e], b[e], c[e], ab[e], bc[e], ca[e])
            low = min(a[e], min(b[e], min(c[e], min(ab[e], min(bc[e], ca[e])))))
            high = max(a[e], max(b[e], max(c[e], max(ab[e], max(bc[e], ca[e])))))
            # a pole may lie inside, up to the distance between nodes
            is_zero = low - (high - low) > limit or bend[e] < 0
            bend[e] = _CULLED if is_zero else max(bend[e], curve_bend)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _sum_bends(gamma, num, bend_sum):  # type: ignore[no-untyped-def]
    """Sum the deviation of each angle at the edge midpoints from linear. bend_sum: (C, …), written."""
    num = _padded(num)
    for k in range(gamma.shape[0]):
        a, b, c, ab, bc, ca = gamma[k, 0], gamma[k, 1], gamma[k, 2], gamma[k, 3], gamma[k, 4], gamma[k, 5]
        curve_bend_sum = bend_sum[k]
        for e in range(num):
            curve_bend_sum[e] = ab[e] + bc[e] + ca[e] - (a[e] + b[e] + c[e])


# Inlined like its callers: a call would copy all fields of its arguments, which took an eighth of the projector's time.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _append(triangles, triangle_index, count, nodes, bent, area_fraction, scratch, num):  # type: ignore[no-untyped-def]
    """Append the triangles between three nodes of listed triangles to the subtriangles; return the new number.

    Corners move by `bent` times the bend of the angles, which nearly always has one sign
    (docs/direct-light.md#algorithm).
    """
    subtriangles = scratch.subtriangles
    for k in range(triangles.gamma.shape[0]):
        curve_bend_sum = scratch.bend_sum[k]
        for corner in range(3):
            angle, corner_angles = triangles.gamma[k, nodes[corner]], subtriangles.corners[k, corner]
            for n in range(count):
                w = np.uint64(triangle_index[n])
                corner_angles[num + n] = max(angle[w] + bent * curve_bend_sum[w], np.float32(0))
    for n in range(count):
        subtriangles.entry[num + n] = triangles.origin[np.uint64(triangle_index[n])]
    subtriangles.area_fraction[num : num + count] = area_fraction
    return num + count


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _classify_triangles(triangles, num_triangles, level, fine, scratch, num):  # type: ignore[no-untyped-def]
    """Append triangles with linear angles as one subtriangle, and those that one division makes linear as four.

    Args:
        fine: see `project_points`. scratch: has their bends; those to be divided further are left in its third list.
    Returns:
        The new number of subtriangles, and the number of triangles to divide.
    """
    lists, bend = scratch.lists, scratch.bend
    num_whole = num_quartered = num_divided = _BEGIN
    max_whole_bend, last_level = fine
    max_quartered_bend, is_last = _QUARTERED_BEND * max_whole_bend, level == last_level
    for n in range(num_triangles):
        lists[0, num_whole] = n
        lists[1, num_quartered] = n
        lists[2, num_divided] = n
        is_whole, is_simple = bend[n] <= max_whole_bend, bend[n] <= max_quartered_bend or is_last
        num_whole += (bend[n] >= 0) & is_whole
        num_quartered += is_simple & (not is_whole)
        num_divided += (not is_simple) & (not is_whole)
    area_fraction = _QUARTER**level
    _sum_bends(triangles.gamma, num_triangles, scratch.bend_sum)
    num = _append(triangles, lists[0], num_whole, _WHOLE, _THIRD, area_fraction, scratch, num)
    for child in range(4):
        nodes = (_CHILDREN[child, 0], _CHILDREN[child, 1], _CHILDREN[child, 2])
        # a quarter of a triangle has a quarter of the bend
        bent, child_fraction = _QUARTER * _THIRD, _QUARTER * area_fraction
        num = _append(triangles, lists[1], num_quartered, nodes, bent, child_fraction, scratch, num)
    return num, num_divided


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _children(triangles, triangle_index, count, children):  # type: ignore[no-untyped-def]
    """Create the four children of the listed triangles: corners and edge midpoints. Return their number."""
    local, gamma, child_local, child_gamma = triangles.local, triangles.gamma, children.local, children.gamma
    for child in range(4):
        begin = child * count
        for corner in range(3):
            node = _CHILDREN[child, corner]
            for axis in range(3):
                parent_values, child_values = local[axis, node], child_local[axis, corner]
                for n in range(count):
                    child_values[begin + n] = parent_values[np.uint64(triangle_index[n])]
            for k in range(gamma.shape[0]):
                parent_values, child_values = gamma[k, node], child_gamma[k, corner]
                for n in range(count):
                    child_values[begin + n] = parent_values[np.uint64(triangle_index[n])]
        for n in range(count):
            children.origin[begin + n] = triangles.origin[np.uint64(triangle_index[n])]
    for edge in range(3):
        next_edge = (edge + 1) % 3
        for n in range(_padded(4 * count)):
            x = child_local[0, edge, n] + child_local[0, next_edge, n]
            y = child_local[1, edge, n] + child_local[1, next_edge, n]
            z = child_local[2, edge, n] + child_local[2, next_edge, n]
            inverse = np.float32(1) / math.sqrt(x * x + y * y + z * z)
            child_local[0, 3 + edge, n] = x * inverse
            child_local[1, 3 + edge, n] = y * inverse
            child_local[2, 3 + edge, n] = z * inverse
    return 4 * count


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _angles(curves, wo, local, first_node, num, gamma):  # type: ignore[no-untyped-def]
    """Compute the angles of all curves at nodes [first_node, 6) of the first triangles, in bands.

    wo: times `Curve.axes`, one for each curve. (C, 3). gamma: (C, 6, …), written.
    """
    kinds, scale, num = curves.kinds, curves.scale, _padded(num)
    is_pair = False  # evaluated with the previous curve
    for k in range(kinds.shape[0]):
        if is_pair:
            is_pair = False
            continue
        is_pair = k + 1 < kinds.shape[0] and kinds[k] == ALPHA and kinds[k + 1] == BETA
        for node in range(first_node, 6):
            x, y, z = local[0, node, :num], local[1, node, :num], local[2, node, :num]
            if is_pair:
                compute_alpha_beta(
                    scale[k : k + 2], x, y, z, wo[k, 0], wo[k, 1], wo[k, 2], gamma[k, node], gamma[k + 1, node]
                )
            else:
                compute_angles(kinds[k], scale[k], x, y, z, wo[k, 0], wo[k, 1], wo[k, 2], gamma[k, node])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _divide(curves, fine, triangles, count, scratch, num):  # type: ignore[no-untyped-def]
    """Divide the first `count` triangles of the third list recursively until every angle is linear over each.

    Returns:
        The new number of subtriangles.
    """
    levels = scratch.divided
    for level in range(1, fine[1] + 1):
        children = Triangles(levels.local[level & 1], levels.gamma[level & 1], levels.origin[level & 1])
        num_children = _children(triangles, scratch.lists[2], count, children)
        _angles(curves, scratch.wo, children.local, _MIDDLES, num_children, children.gamma)
        _bends(children.gamma, curves.support, num_children, scratch.bend)
        num, count = _classify_triangles(children, num_children, level, fine, scratch, num)
        triangles = children
    return num


def make_scratch(num_curves: int, num_lights: int, num_settings: int) -> ProjectorScratch:
    """Allocate the scratch memory of `project_points`.

    Args:
        num_curves: C. num_lights: maximum number of listed triangles. num_settings: columns of `Contraction.settings`.
    """
    capacity = -(-num_lights // _LANES) * _LANES
    widest = max(capacity, _MAX_DIVIDED)
    whole = Triangles(
        np.zeros((3, 6, capacity), np.float32), np.empty((num_curves, 6, capacity), np.float32), np.arange(widest)
    )
    divided = Triangles(
        np.zeros((2, 3, 6, _MAX_DIVIDED), np.float32),
        np.zeros((2, num_curves, 6, _MAX_DIVIDED), np.float32),
        np.empty((2, _MAX_DIVIDED), np.int64),
    )
    lists, batches = np.empty((3, widest + 1), np.int64), np.empty(num_lights, np.int64)
    bend, bend_sum = np.empty(widest, np.float32), np.empty((num_curves, widest), np.float32)
    subtriangles = allocate_subtriangles(num_curves, 4 * num_lights + _MAX_SUBTRIANGLES, num_settings)
    wo = np.empty((num_curves, 3), np.float32)
    return ProjectorScratch(wo, whole, divided, lists, batches, bend, bend_sum, subtriangles)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def project_points(points, listed, shading, nodes, irradiance, curves, fine, start, stop, scratch, out):  # type: ignore[no-untyped-def]
    """Project the listed lights of points [start, stop).

    Args:
        points: `SurfacePoints`. start, stop: range of points. listed: from `list_lights`.
        shading: q · cos θi of each entry, one row for all channels, or three. (1 or 3, K) float32
        nodes: of the lights. (3 axes, 6, M) float32. irradiance: of the lights, per channel. (M, 3) float32
        curves: `Contraction`.
        fine: tolerance of the bend, relative to exact operators; last level of division. `FINE` or `COARSE`.
        scratch: from `make_scratch`.
        out: added to. (points, 3, J padded by 8) float32; with no free curve (points, 3, N) for N settings of the
            others.
    """
    whole, lists, batches, subtriangles = scratch.whole, scratch.lists, scratch.batches, scratch.subtriangles
    for p in range(start, stop):
        row = p - start
        begin, num_entries = listed.first[row], listed.first[row + 1] - listed.first[row]
        if num_entries == 0:
            continue
        scale_by_axes(curves.axes, listed.wo, begin, scratch.wo)
        if curves.kinds.shape[0] > 0:
            light = listed.light[begin : begin + num_entries]
            _rotate_nodes(points.normal[p], points.tangent[p], nodes, light, whole.local)
        _angles(curves, scratch.wo, whole.local, _BEGIN, num_entries, whole.gamma)
        _bends(whole.gamma, curves.support, num_entries, scratch.bend)
        num, num_divided = _classify_triangles(whole, num_entries, _BEGIN, fine, scratch, _BEGIN)
        for n in range(num_divided):
            batches[n] = lists[2, n]
        for batch in range(0, num_divided, _BATCH):
            if num + _MAX_SUBTRIANGLES > subtriangles.entry.shape[0]:
                add_subtriangles(subtriangles, num, listed, shading, begin, irradiance, curves, out[row])
                num = _BEGIN
            count = min(_BATCH, num_divided - batch)
            for n in range(count):
                lists[2, n] = batches[batch + n]
            num = _divide(curves, fine, whole, count, scratch, num)
        add_subtriangles(subtriangles, num, listed, shading, begin, irradiance, curves, out[row])
