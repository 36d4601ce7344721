"""Kernels of the projector: angles of the listed lights, and their subdivision.

A subtriangle is a triangle over which every angle is linear: a light triangle, or a part of one near an angle's pole
(appendix A, Ben-Artzi 2006). All triangles of a level are divided together, and subtriangles are collected in arrays
and processed together, so that each loop fits the registers and fills them. Passing arrays to a helper inside a hot
loop would count references.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.angles import ALPHA, BETA, compute_alpha_beta, compute_angles
from relume.core.numba_options import NO_REFCOUNT
from relume.transport.triangle_kernel import add_subtriangles, weight_subtriangles

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
_BEGIN, _MIDDLES, _WHOLE = np.int64(0), np.int64(3), (0, 1, 2)
_BATCH = 16  # lights divided together
# Loops are padded to a multiple of this: vectorized code and remainder loops round differently, and the result of a
# triangle must not depend on which others are culled.
_LANES = 32
_MAX_DIVIDED = _BATCH * 4 ** (_MAX_DEPTH - 1)
_MAX_SUBTRIANGLES = _BATCH * 4**_MAX_DEPTH
_SUBTRIANGLES_PER_BATCH = 64  # multiplied by the settings of a curve


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
def _rotate_nodes(n, t, nodes, light, begin, end, local):  # type: ignore[no-untyped-def]
    """Rotate the nodes of listed lights into the frame of normal n and tangent t. local: (3, 6, entries), written."""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    for node in range(6):
        for entry in range(begin, end):
            m = np.uint64(light[entry])
            x, y, z = nodes[0, node, m], nodes[1, node, m], nodes[2, node, m]
            local[0, node, entry - begin] = t[0] * x + t[1] * y + t[2] * z
            local[1, node, entry - begin] = bx * x + by * y + bz * z
            local[2, node, entry - begin] = n[0] * x + n[1] * y + n[2] * z


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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _append(  # type: ignore[no-untyped-def]
    gamma,
    bend_sum,
    triangle_index,
    count,
    nodes,
    bent,
    origin,
    area_fraction,
    subtriangles,
    area_fractions,
    entry_index,
    num,
):
    """Append the triangles between three nodes of listed triangles to the subtriangles; return the new number.

    Corners move by `bent` times the bend of the angles, which nearly always has one sign
    (docs/direct-light.md#algorithm).
    """
    for k in range(gamma.shape[0]):
        curve_bend_sum = bend_sum[k]
        for corner in range(3):
            angle, corner_angles = gamma[k, nodes[corner]], subtriangles[k, corner]
            for n in range(count):
                w = np.uint64(triangle_index[n])
                corner_angles[num + n] = max(angle[w] + bent * curve_bend_sum[w], np.float32(0))
    for n in range(count):
        entry_index[num + n] = origin[np.uint64(triangle_index[n])]
    area_fractions[num : num + count] = area_fraction
    return num + count


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _classify_triangles(  # type: ignore[no-untyped-def]
    gamma, bend, bend_sum, num_triangles, level, fine, origin, subtriangles, area_fractions, entry_index, num, lists
):
    """Append triangles with linear angles as one subtriangle, and those that one division makes linear as four.

    Args:
        fine: see `project_points`. origin: light of each triangle.
        lists: scratch for triangle indices; those to be divided further are left in lists[2].
    Returns:
        The new number of subtriangles, and the number of triangles to divide.
    """
    num_whole = num_quartered = num_divided = 0
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
    _sum_bends(gamma, num_triangles, bend_sum)
    num = _append(
        gamma,
        bend_sum,
        lists[0],
        num_whole,
        _WHOLE,
        _THIRD,
        origin,
        area_fraction,
        subtriangles,
        area_fractions,
        entry_index,
        num,
    )
    for child in range(4):
        nodes = (_CHILDREN[child, 0], _CHILDREN[child, 1], _CHILDREN[child, 2])
        child_fraction = _QUARTER * area_fraction
        # a quarter of a triangle has a quarter of the bend
        bent = _QUARTER * _THIRD
        num = _append(
            gamma,
            bend_sum,
            lists[1],
            num_quartered,
            nodes,
            bent,
            origin,
            child_fraction,
            subtriangles,
            area_fractions,
            entry_index,
            num,
        )
    return num, num_divided


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _children(local, gamma, origin, triangle_index, count, child_local, child_gamma, child_origin):  # type: ignore[no-untyped-def]
    """Create the four children of the listed triangles: corners and edge midpoints. Return their number."""
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
            child_origin[begin + n] = origin[np.uint64(triangle_index[n])]
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
def _angles(kinds, scale, wo, local, first_node, num, gamma):  # type: ignore[no-untyped-def]
    """Compute the angles of all curves at nodes [first_node, 6) of the first triangles, in bands.

    wo: times `Curve.axes`, one for each curve. (C, 3). gamma: (C, 6, …), written.
    """
    num = _padded(num)
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _divide(  # type: ignore[no-untyped-def]
    kinds, scale, wo, support, fine, local, gamma, origin, count, generations, lists, bend, bend_sum, subtriangles,
    area_fractions, entry_index, num
):  # fmt: skip
    """Divide the first `count` triangles of lists[2] recursively until every angle is linear over each.

    Args:
        generations: local, gamma and origin of two generations of divided triangles, written alternately.
    Returns:
        The new number of subtriangles.
    """
    all_local, all_gamma, all_origin = generations
    for level in range(1, fine[1] + 1):
        to_local, to_gamma, to_origin = all_local[level & 1], all_gamma[level & 1], all_origin[level & 1]
        num_children = _children(local, gamma, origin, lists[2], count, to_local, to_gamma, to_origin)
        _angles(kinds, scale, wo, to_local, _MIDDLES, num_children, to_gamma)
        _bends(to_gamma, support, num_children, bend)
        num, count = _classify_triangles(
            to_gamma,
            bend,
            bend_sum,
            num_children,
            level,
            fine,
            to_origin,
            subtriangles,
            area_fractions,
            entry_index,
            num,
            lists,
        )
        local, gamma, origin = to_local, to_gamma, to_origin
    return num


@nb.njit(nogil=True, cache=True)
def make_scratch(num_curves, num_lights, num_settings):  # type: ignore[no-untyped-def]
    """Allocate the scratch memory of `project_points` once, rather than for every block of points.

    Args:
        num_curves: C. num_lights: maximum number of listed triangles. num_settings: see `Contraction`.
    """
    capacity = 4 * num_lights + _MAX_SUBTRIANGLES
    return _make_light_scratch(num_curves, num_lights), _make_subtriangle_scratch(num_curves, capacity, num_settings)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _make_light_scratch(num_curves, num_lights):  # type: ignore[no-untyped-def]
    """Allocate memory for lights: local nodes, angles, generations, origins, lists, bends, sums of bends."""
    capacity = _padded(num_lights)
    widest = max(capacity, _MAX_DIVIDED)
    local, gamma = np.zeros((3, 6, capacity), np.float32), np.empty((num_curves, 6, capacity), np.float32)
    generations = (
        np.zeros((2, 3, 6, _MAX_DIVIDED), np.float32),
        np.zeros((2, num_curves, 6, _MAX_DIVIDED), np.float32),
        np.empty((2, _MAX_DIVIDED), np.int64),
    )
    lists, bend = np.empty((3, widest + 1), np.int64), np.empty(widest, np.float32)
    bend_sum = np.empty((num_curves, widest), np.float32)
    return local, gamma, generations, np.arange(widest), lists, bend, bend_sum, np.empty(num_lights, np.int64)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _make_subtriangle_scratch(num_curves, capacity, num_settings):  # type: ignore[no-untyped-def]
    """Allocate memory for subtriangles: corners, fractions, entries, overlaps, weights, means and products."""
    subtriangles, area_fractions = np.empty((num_curves, 3, capacity), np.float32), np.empty(capacity, np.float32)
    overlaps, weight = np.empty((5, capacity), np.float32), np.empty((3, capacity), np.float32)
    mean, product = np.empty(num_settings, np.float32), np.empty((_SUBTRIANGLES_PER_BATCH, num_settings), np.float32)
    return subtriangles, area_fractions, np.empty(capacity, np.int64), overlaps, weight, mean, product


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def project_points(  # type: ignore[no-untyped-def]
    normal, tangent, first, light, shading, local_wo, nodes, irradiance,
    kinds, axes, num_bands, bands, decrements, num_rows, settings, setting_index, support, active, fine, start, stop,
    scratch,
    out,
):  # fmt: skip
    """Project the listed lights of points [start, stop).

    Args:
        normal, tangent: shading frames of all points. (n, 3) float32. start, stop: range of points.
        first, light, local_wo: from `list_lights`.
        shading: q · cos θi of each entry, one row for all channels, or three. (1 or 3, K) float32
        nodes: nodes of the lights. (3 axes, 6, M) float32.
        irradiance: irradiance of the lights, per channel. (M, 3) float32
        kinds, axes, num_bands, bands, decrements, num_rows, settings, setting_index, support, active: see
        `Contraction`.
        fine: tolerance of the bend, relative to exact operators; last level of division. `FINE` or `COARSE`.
        scratch: from `make_scratch`.
        out: added to. (points, 3, J padded by 8) float32; with no free curve (points, 3, N) for N settings of the
            others.
    """
    num_curves = kinds.shape[0]
    scale = np.empty(num_curves, np.float32)
    for k in range(num_curves):
        scale[k] = num_bands[k] / (np.pi / 2)
    local, gamma, generations, origin, lists, bend, bend_sum, divided = scratch[0]
    subtriangles, area_fractions, entry_index, overlaps, weight, mean, product = scratch[1]
    capacity = area_fractions.shape[0]
    scaled_wo = np.empty((num_curves, 3), np.float32)
    for p in range(start, stop):
        row = p - start
        begin, num_entries = first[row], first[row + 1] - first[row]
        if num_entries == 0:
            continue
        for k in range(num_curves):
            for axis in range(3):
                scaled_wo[k, axis] = axes[k, axis] * local_wo[axis, begin]
        if num_curves > 0:
            _rotate_nodes(normal[p], tangent[p], nodes, light, begin, begin + num_entries, local)
        _angles(kinds, scale, scaled_wo, local, _BEGIN, num_entries, gamma)
        _bends(gamma, support, num_entries, bend)
        num, num_divided = _classify_triangles(
            gamma,
            bend,
            bend_sum,
            num_entries,
            _BEGIN,
            fine,
            origin,
            subtriangles,
            area_fractions,
            entry_index,
            _BEGIN,
            lists,
        )
        divided[:num_divided] = lists[2, :num_divided]
        for batch in range(0, num_divided, _BATCH):
            if num + _MAX_SUBTRIANGLES > capacity:
                weight_subtriangles(irradiance, light, shading, begin, entry_index, area_fractions, num, weight)
                add_subtriangles(
                    subtriangles, num, num_bands, bands, decrements, num_rows, settings, setting_index, active,
                    overlaps, weight, mean, product, out[row],
                )  # fmt: skip
                num = 0
            count = min(_BATCH, num_divided - batch)
            lists[2, :count] = divided[batch : batch + count]
            num = _divide(
                kinds, scale, scaled_wo, support, fine, local, gamma, origin, count, generations, lists, bend, bend_sum,
                subtriangles, area_fractions, entry_index, num,
            )  # fmt: skip
        weight_subtriangles(irradiance, light, shading, begin, entry_index, area_fractions, num, weight)
        add_subtriangles(
            subtriangles, num, num_bands, bands, decrements, num_rows, settings, setting_index, active,
            overlaps, weight, mean, product, out[row],
        )  # fmt: skip
