"""The kernels of a term with all its curves contracted: light triangles weighed by the means of its curves.

Nothing is shared out to bands, so a triangle needs only where its angles lie and how far they spread: a curve's mean is
taken over a box about the mean angle, as wide as the angle varies (first and second moments, from the midpoints of
the edges). Triangles over which that would not do are divided, where they matter to the point at all.

Most loops write one array: for more the compiler's vectoriser would need more checks of what may alias than it is
allowed. Those that look something up cannot be vectorised; they do as much as they can with what they loaded.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.angles import LOBE, THETA_D, THETA_I, THETA_R, angles_into

_ZERO, _ONE, _HALF = np.float32(0), np.float32(1), np.float32(0.5)
_THIRD, _QUARTER = np.float32(1 / 3), np.float32(0.25)
# corners of the four children among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_CHUNK = 256  # triangles evaluated together: their scratch memory stays in a core's first-level cache
_MAX_DEPTH = 6
# Half of a box has at least this width, in bands: sums of bands are differences of larger ones.
_LEAST_HALF = np.float32(0.025)
_CORNER = np.float32(1.64)
# A curve that varies by its own mean within a triangle's reach gives it at most about this share of that as an error:
# where the angle is linear, since a box is no triangle; by an angle's pole in the ratio of reach and distance.
_SHAPE, _BEND, _MOST_BEND = np.float32(0.08), np.float32(0.05), np.float32(0.5)
# Triangles are divided whose error may be above both: a share of what they bring, and of all that the point receives.
_TOLERANCE, _TOLERANCE_OF_ALL = np.float32(0.02), np.float32(1e-3)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _spread(gamma, num, mean, half):  # type: ignore[no-untyped-def]
    """Find mean angles of triangles, and half the widths of boxes in which angles vary alike. gamma: (3, ≥ num)"""
    a, b, c = gamma[0], gamma[1], gamma[2]
    for n in range(num):
        mean[n] = (a[n] + b[n] + c[n]) * _THIRD
    for n in range(num):
        ab, bc, ca = a[n] - b[n], b[n] - c[n], c[n] - a[n]
        # the variance over a triangle, from midpoints of its edges, is a ninth of this; a box has a third of half²
        half[n] = max(math.sqrt((ab * ab + bc * bc + ca * ca) * _THIRD), _LEAST_HALF)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _reach_into(kind, scale, wo, local, radius, half, num, reach):  # type: ignore[no-untyped-def]
    """Bound how far an angle varies within triangles, in bands.

    Args:
        kind: an `Angle`. scale: bands per radian. wo: times `Curve.axes`. (3,) local, radius: as in `_evaluate`.
        half: from `_spread`: corners are 1.63 of it away at most, where the angle is linear. reach: written. (≥ num,)
    """
    if kind in (THETA_I, THETA_R, LOBE):
        for n in range(num):
            reach[n] = max(scale * radius[n], _CORNER * half[n])
    elif kind == THETA_D:
        for n in range(num):
            reach[n] = max(_HALF * scale * radius[n], _CORNER * half[n])
    else:  # the half vector turns by half as much, or by more across the plane of wi and wo: 1 / (2 cos θd)
        x, y, z = local[0, 3], local[1, 3], local[2, 3]
        for n in range(num):
            cosine = wo[0] * x[n] + wo[1] * y[n] + wo[2] * z[n]
            turned = _HALF * scale * radius[n] / math.sqrt(max(_HALF + _HALF * cosine, np.float32(1e-4)))
            reach[n] = max(turned, _CORNER * half[n])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _ends(mean, half, last, num, low, high):  # type: ignore[no-untyped-def]
    """Find where boxes begin and end, in bands. last: angle in the last band."""
    for n in range(num):
        low[n] = min(max(mean[n] - half[n], _ZERO), last - _LEAST_HALF)
    for n in range(num):
        high[n] = max(min(mean[n] + half[n], last), low[n] + _LEAST_HALF)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _integrals(steps, low, high, num, integral):  # type: ignore[no-untyped-def]
    """Integrate a curve from where boxes begin to where they end.

    Args:
        steps: of the curve, see `WholeCurves`. (≥ J, 3) low, high: from `_ends`. integral: written. (≥ num,) each
    """
    for n in range(num):
        first, final = np.uint32(low[n]), np.uint32(high[n])
        begins, ends = low[n] - np.float32(first), high[n] - np.float32(final)
        whole = steps[first, 1] - steps[final, 1]
        integral[n] = whole - begins * steps[first, 0] + ends * steps[final, 0]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _means(low, high, num, value):  # type: ignore[no-untyped-def]
    """Divide integrals over boxes by their widths."""
    for n in range(num):
        value[n] /= high[n] - low[n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _variations(steps, mean, reach, last, num, variation):  # type: ignore[no-untyped-def]
    """Find by how much a curve varies within reach of mean angles.

    Args:
        steps: as in `_integrals`. mean, reach: in bands. last: angle in the last band. variation: written.
    """
    for n in range(num):
        first, final = np.uint32(max(mean[n] - reach[n], _ZERO)), np.uint32(min(mean[n] + reach[n], last))
        variation[n] = steps[first, 2] - steps[final, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_errors(mean, reach, variation, value, num, error):  # type: ignore[no-untyped-def]
    """Add what a curve's means over boxes may be wrong by, as a share of them.

    Args:
        mean, reach, variation: as in `_variations`. value: the means. error: added to. (≥ num,) each
    """
    for n in range(num):
        bend = min(_BEND * reach[n] / max(mean[n], np.float32(1e-6)), _MOST_BEND)
        error[n] += (_SHAPE + bend) * variation[n] / max(value[n], np.float32(1e-30))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _multiply(factor, num, value):  # type: ignore[no-untyped-def]
    for n in range(num):
        value[n] *= factor[n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _evaluate(curves, scale, wo, local, radius, num, scratch, value, error):  # type: ignore[no-untyped-def]
    """Multiply the means of all curves over triangles.

    Args:
        curves: kinds, steps, numbers of rows and of bands, see `WholeCurves`. scale: bands per radian. (C,)
        wo: times `Curve.axes`, one for each curve. (C, 3)
        local: corners and midpoints of edges, of which only these are read. (3 axes, 6, ≥ num)
        radius: of the triangles, radians. (≥ num,)
        scratch: (10, ≥ num). value: written. (1 or 3, ≥ num) error: share of it, written. (≥ num,)
    """
    kinds, steps, num_rows, _ = curves
    gamma, mean, half, reach, low = scratch[:3], scratch[3], scratch[4], scratch[5], scratch[6]
    high, one, variation = scratch[7], scratch[8], scratch[9]
    value[:, :num] = 1
    error[:num] = 0
    for k in range(kinds.shape[0]):
        for node in range(3):
            angles_into(
                kinds[k], scale[k], local[0, 3 + node, :num], local[1, 3 + node, :num], local[2, 3 + node, :num],
                wo[k, 0], wo[k, 1], wo[k, 2], gamma[node],
            )  # fmt: skip
        last = scale[k] * np.float32(math.pi / 2 * (1 - 1e-6))
        _spread(gamma, num, mean, half)
        _reach_into(kinds[k], scale[k], wo[k], local, radius, half, num, reach)
        _ends(mean, half, last, num, low, high)
        for row in range(value.shape[0]):
            if row < num_rows[k]:
                _integrals(steps[k, row], low, high, num, one)
                _means(low, high, num, one)
                _variations(steps[k, row], mean, reach, last, num, variation)
                _add_errors(mean, reach, variation, one, num, error)
            _multiply(one, num, value[row])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _look_up(nodes, node, light, begin, num, x, y, z):  # type: ignore[no-untyped-def]
    """Look up a node of listed lights [begin, begin + num). nodes: (M, 6, 3)"""
    for k in range(num):
        m = np.uint32(light[begin + k])
        x[k], y[k], z[k] = nodes[m, node, 0], nodes[m, node, 1], nodes[m, node, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _look_up_middles(nodes, light, begin, num, local):  # type: ignore[no-untyped-def]
    """Look up the midpoints of edges of listed lights [begin, begin + num). local: written. (3, 6, ≥ num)"""
    ab_x, bc_x, ca_x = local[0, 3], local[0, 4], local[0, 5]
    ab_y, bc_y, ca_y = local[1, 3], local[1, 4], local[1, 5]
    ab_z, bc_z, ca_z = local[2, 3], local[2, 4], local[2, 5]
    for k in range(num):  # no vectors, whatever the order: so all of a light, which lies together
        m = np.uint32(light[begin + k])
        ab_x[k], ab_y[k], ab_z[k] = nodes[m, 3, 0], nodes[m, 3, 1], nodes[m, 3, 2]
        bc_x[k], bc_y[k], bc_z[k] = nodes[m, 4, 0], nodes[m, 4, 1], nodes[m, 4, 2]
        ca_x[k], ca_y[k], ca_z[k] = nodes[m, 5, 0], nodes[m, 5, 1], nodes[m, 5, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _turn(n, t, first_node, num, local):  # type: ignore[no-untyped-def]
    """Turn nodes [first_node, 6) into the frame of normal n and tangent t. local: (3, 6, ≥ num)"""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    tx, ty, tz, nx, ny, nz = t[0], t[1], t[2], n[0], n[1], n[2]
    for node in range(first_node, 6):
        a, b, c = local[0, node], local[1, node], local[2, node]
        for k in range(num):
            x, y, z = a[k], b[k], c[k]
            a[k] = tx * x + ty * y + tz * z
            b[k] = bx * x + by * y + bz * z
            c[k] = nx * x + ny * y + nz * z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _weigh(brings, light, shading, begin, num, weight, reach):  # type: ignore[no-untyped-def]
    """Look up what listed lights [begin, begin + num) bring, and how wide they are.

    Args:
        brings: irradiance, radius. (M, 4) light: (K,). shading: (1 or 3, K).
        weight: irradiance · q cos θi, written. (3, ≥ num) reach: radius, written. (≥ num,)
    """
    blue_row = shading.shape[0] - 1
    red, green, blue = weight[0], weight[1], weight[2]
    for k in range(num):
        m = np.uint32(light[begin + k])
        red[k] = brings[m, 0] * shading[0, begin + k]
        green[k] = brings[m, 1] * shading[blue_row // 2, begin + k]
        blue[k] = brings[m, 2] * shading[blue_row, begin + k]
        reach[k] = brings[m, 3]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sum_up(value, weight, num, total):  # type: ignore[no-untyped-def]
    """Add weight (3, ≥ num) times value (1 or 3, ≥ num) to the total (3,)."""
    blue_row = value.shape[0] - 1
    for channel in range(3):
        of_channel, factor, added = weight[channel], value[blue_row * channel // 2], np.float32(0)
        for n in range(num):
            added += of_channel[n] * factor[n]
        total[channel] += added


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _set_aside(value, weight, error, num, least, which):  # type: ignore[no-untyped-def]
    """List the triangles to be divided, and let them bring nothing as they are; returns their number.

    Args:
        value, weight, error: as from `_evaluate` and `_weigh`; errors are spoilt. least: what may be wrong.
        which: written. (> num,)
    """
    blue_row = value.shape[0] - 1
    red, green, blue = value[0], value[blue_row // 2], value[blue_row]
    for n in range(num):
        brought = weight[0, n] * red[n] + weight[1, n] * green[n] + weight[2, n] * blue[n]
        error[n] = _ONE if (error[n] > _TOLERANCE) & (error[n] * brought > least) else _ZERO
    count = 0
    for n in range(num):
        which[count] = n
        count += int(error[n])
    for row in range(blue_row + 1):
        of_row = value[row]
        for n in range(num):
            of_row[n] *= _ONE - error[n]
    return count


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _copy(source, which, target):  # type: ignore[no-untyped-def]
    for n in range(which.shape[0]):
        target[n] = source[which[n]]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _divide(local, weight, radius, which, parent, to_local, to_weight, to_radius):  # type: ignore[no-untyped-def]
    """Make the four children of the listed triangles; returns their number.

    Args:
        local, weight, radius: of a generation, as in `_evaluate` and `_weigh`. which: the listed. (n,)
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_divided(curves, scale, wo, num, least, generations, scratch, total):  # type: ignore[no-untyped-def]
    """Add triangles that are divided: the first `num` of the first generation, and what comes of them.

    Args:
        curves, scale, wo, scratch: as in `_evaluate`. least: as in `_set_aside`.
        generations: local, weight, radius, which, value and error of each, written but for the first's first three.
        total: added to. (3,)
    """
    local, weight, radius, which, value, error = generations
    count, done = np.zeros(_MAX_DEPTH + 1, np.int64), np.zeros(_MAX_DEPTH + 1, np.int64)
    parent = np.empty((22, _CHUNK // 4), np.float32)
    for n in range(num):
        which[0, n] = n
    level, count[0] = 0, num
    while level >= 0:
        if done[level] == count[level]:
            level -= 1
            continue
        listed = which[level, done[level] : min(done[level] + _CHUNK // 4, count[level])]
        done[level] += len(listed)
        to = level + 1
        parts = _divide(local[level], weight[level], radius[level], listed, parent, local[to], weight[to], radius[to])
        _evaluate(curves, scale, wo, local[to], radius[to], parts, scratch, value[to], error[to])
        done[to] = count[to] = 0
        if to < _MAX_DEPTH:
            count[to] = _set_aside(value[to], weight[to], error[to], parts, least, which[to])
        _sum_up(value[to], weight[to], parts, total)
        level = to


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _scratch(num, num_rows):  # type: ignore[no-untyped-def]
    """Make room for `num` chunks of triangles: weight, radius, which are divided, value, error."""
    weight, radius = np.empty((num, 3, _CHUNK), np.float32), np.empty((num, _CHUNK), np.float32)
    value, error = np.empty((num, num_rows, _CHUNK), np.float32), np.empty((num, _CHUNK), np.float32)
    return weight, radius, np.empty((num, _CHUNK + 1), np.int64), value, error


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def shade_points(  # type: ignore[no-untyped-def]
    normal, tangent, first, light, shading, local_wo, nodes, brings, axes, curves, start, stop, out
):
    """Add what the listed lights bring to points [start, stop).

    Args:
        normal, tangent, first, light, shading, local_wo, start, stop: as in `project_points`.
        nodes: of the lights. (M, 6, 3) float32 brings: their irradiance and, in radians, radius. (M, 4) float32
        axes: `Curve.axes` of each. (C, 3) float32
        curves: see `_evaluate`.
        out: added to; what is there is part of what a point receives. (points, 3, ≥ 1) float32
    """
    num_curves, num_rows = axes.shape[0], 1
    scale, wo = np.empty(num_curves, np.float32), np.empty((num_curves, 3), np.float32)
    for k in range(num_curves):
        num_rows = max(num_rows, curves[2][k])
        scale[k] = curves[3][k] / (np.pi / 2)
    weight, reach, which, value, error = _scratch(nodes.shape[0] // _CHUNK + 1, num_rows)
    local, scratch = np.empty((_MAX_DEPTH + 1, 3, 6, _CHUNK), np.float32), np.empty((10, _CHUNK), np.float32)
    of_parts, total = _scratch(_MAX_DEPTH + 1, num_rows), np.empty(3, np.float32)
    chosen, generations = np.empty(_CHUNK, np.int32), (local, *of_parts)
    for p in range(start, stop):
        begin, end = first[p - start], first[p - start + 1]
        if begin == end:
            continue
        for k in range(num_curves):
            for axis in range(3):
                wo[k, axis] = axes[k, axis] * local_wo[axis, begin]
        total[:] = 0
        for chunk in range((end - begin + _CHUNK - 1) // _CHUNK):
            at = begin + chunk * _CHUNK
            num = min(_CHUNK, end - at)
            if num_curves > 0:
                _look_up_middles(nodes, light, at, num, local[0])
                _turn(normal[p], tangent[p], 3, num, local[0])
            _weigh(brings, light, shading, at, num, weight[chunk], reach[chunk])
            _evaluate(curves, scale, wo, local[0], reach[chunk], num, scratch, value[chunk], error[chunk])
            _sum_up(value[chunk], weight[chunk], num, total)
        if num_curves == 0:
            out[p - start, :, 0] += total
            continue
        for channel in range(3):  # what is there already counts as well
            total[channel] += abs(out[p - start, channel, 0])
        least = _TOLERANCE_OF_ALL * (total[0] + total[1] + total[2])
        total[:] = 0
        for chunk in range((end - begin + _CHUNK - 1) // _CHUNK):
            at = begin + chunk * _CHUNK
            num = min(_CHUNK, end - at)
            divided = _set_aside(value[chunk], weight[chunk], error[chunk], num, least, which[chunk])
            _sum_up(value[chunk], weight[chunk], num, total)
            if divided == 0:
                continue
            listed = which[chunk, :divided]
            _copy(light[at : at + num], listed, chosen)
            _copy(reach[chunk], listed, of_parts[1][0])
            for channel in range(3):
                _copy(weight[chunk, channel], listed, of_parts[0][0, channel])
            for node in range(6):
                _look_up(nodes, node, chosen, 0, divided, local[0, 0, node], local[0, 1, node], local[0, 2, node])
            _turn(normal[p], tangent[p], 0, divided, local[0])
            _add_divided(curves, scale, wo, divided, least, generations, scratch, total)
        out[p - start, :, 0] += total
