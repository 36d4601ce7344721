"""The projector's kernels: lists of visible lights, their angles, their division into leaves, their sharing out.

A leaf is a triangle over which every angle is linear: a light triangle, or a part of one near an angle's pole
(appendix A, Ben-Artzi 2006). Leaves are gathered in arrays and spent together, so that each loop is short enough for
the compiler to keep in registers; arrays handed to a helper inside a hot loop would be counted as references there.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.angles import angle_at, angles_into
from relume.transfer.overlap import area_below, overlap_of

_QUARTER = np.float32(0.25)
_HALF = np.float32(0.5)
# An angle counts as linear over a triangle when it is this close to linear at the midpoints of the edges, in bands;
# away from the pole, where curves are wider, a share of the angle more.
_TOLERANCE_BANDS = np.float32(0.12)
_TOLERANCE_SHARE = np.float32(0.015)
_QUARTERED_BEND = np.float32(4)  # division in four quarters the bend, so that up to here one division is enough
_MAX_DEPTH = 4
# corners of the four children among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])
_CULLED = np.float32(-1)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def local_directions(normal, tangent, wo, visible, directions, start, stop, first, light, wi, out):  # type: ignore[no-untyped-def]
    """List the visible lights of points [start, stop) in their local frames.

    Writes first (points + 1,), light (K,), wi (3, K) and wo as `out` (3, K); returns K.
    """
    n = 0
    for p in range(start, stop):
        first[p - start] = n
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        tx, ty, tz = tangent[p, 0], tangent[p, 1], tangent[p, 2]
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        ox = tx * wo[p, 0] + ty * wo[p, 1] + tz * wo[p, 2]
        oy = bx * wo[p, 0] + by * wo[p, 1] + bz * wo[p, 2]
        oz = nx * wo[p, 0] + ny * wo[p, 1] + nz * wo[p, 2]
        for m in range(directions.shape[0]):
            if (visible[p, m >> 3] >> (m & 7)) & 1 == 0:
                continue
            x, y, z = directions[m, 0], directions[m, 1], directions[m, 2]
            light[n] = m
            wi[0, n] = tx * x + ty * y + tz * z
            wi[1, n] = bx * x + by * y + bz * z
            wi[2, n] = nx * x + ny * y + nz * z
            out[0, n], out[1, n], out[2, n] = ox, oy, oz
            n += 1
    first[stop - start] = n
    return n


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _bend_of(a, b, c, ab, bc, ca):  # type: ignore[no-untyped-def]
    """How far an angle at the edges' midpoints is from linear between the corners, in units of what is tolerated."""
    bend = max(abs(ab - _HALF * (a + b)), max(abs(bc - _HALF * (b + c)), abs(ca - _HALF * (c + a))))
    return bend / (_TOLERANCE_BANDS + _TOLERANCE_SHARE * min(a, min(b, c)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _turn_nodes(n, t, nodes, light, begin, end, local):  # type: ignore[no-untyped-def]
    """Turn the nodes of the listed lights into the frame of normal n and tangent t. local: (3, 6, entries), written."""
    bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    for node in range(6):
        for entry in range(begin, end):
            m = np.uint64(light[entry])
            x, y, z = nodes[0, node, m], nodes[1, node, m], nodes[2, node, m]
            local[0, node, entry - begin] = t[0] * x + t[1] * y + t[2] * z
            local[1, node, entry - begin] = bx * x + by * y + bz * z
            local[2, node, entry - begin] = n[0] * x + n[1] * y + n[2] * z


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _bends(gamma, support, num, bend):  # type: ignore[no-untyped-def]
    """The largest bend over all angles of each light, or `_CULLED` where a dormant curve is nothing all over it.

    gamma: angles at the nodes, in bands. (C, 6, ≥ num). bend: (≥ num,), written.
    """
    bend[:num] = 0
    for k in range(gamma.shape[0]):
        a, b, c, ab, bc, ca = gamma[k, 0], gamma[k, 1], gamma[k, 2], gamma[k, 3], gamma[k, 4], gamma[k, 5]
        limit = support[k]
        for e in range(num):
            of_curve = _bend_of(a[e], b[e], c[e], ab[e], bc[e], ca[e])
            low = min(a[e], min(b[e], min(c[e], min(ab[e], min(bc[e], ca[e])))))
            high = max(a[e], max(b[e], max(c[e], max(ab[e], max(bc[e], ca[e])))))
            # a pole may lie inside by as much as the nodes are apart
            is_nothing = low - (high - low) > limit or bend[e] < 0
            bend[e] = _CULLED if is_nothing else max(bend[e], of_curve)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _gather_linear(gamma, num_entries, bend, leaves, shares, of_entry, bent):  # type: ignore[no-untyped-def]
    """Make a leaf of each light over which all angles are linear; list those that bend in `bent`.

    Returns the number of both.
    """
    num = num_bent = 0
    for entry in range(num_entries):
        if bend[entry] < 0:
            continue
        if bend[entry] <= 1:
            of_entry[num] = entry
            num += 1
        else:
            bent[num_bent] = entry
            num_bent += 1
    shares[:num] = 1
    for k in range(gamma.shape[0]):
        for corner in range(3):
            for n in range(num):
                leaves[k, corner, n] = gamma[k, corner, of_entry[n]]
    return num, num_bent


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _quarter(gamma, entry, share, leaves, shares, num):  # type: ignore[no-untyped-def]
    """Append the four triangles that the midpoints of an entry's edges make; returns the new number of leaves."""
    for child in range(4):
        for k in range(gamma.shape[0]):
            for corner in range(3):
                leaves[k, corner, num] = gamma[k, _CHILDREN[child, corner], entry]
        shares[num] = _QUARTER * share
        num += 1
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _divide(  # type: ignore[no-untyped-def]
    kinds, scale, scaled_wo, local, gamma, entry, stack, stack_gamma, depth, dirs, own_gamma, leaves, shares, num
):
    """Divide an entry's triangle in four until its angles are linear, depth first (appendix A).

    Chord areas share out the light. Appends to the corner angles of the leaves (C, 3, n) and their shares (n,); returns
    their new number.
    """
    num_curves = kinds.shape[0]
    for corner in range(3):
        for axis in range(3):
            stack[0, corner, axis] = local[axis, corner, entry]
        for k in range(num_curves):
            stack_gamma[0, k, corner] = gamma[k, corner, entry]
    depth[0] = 0
    top = 1
    while top > 0:
        top -= 1
        level = depth[top]
        dirs[:3] = stack[top]
        for edge in range(3):
            following = (edge + 1) % 3
            x = dirs[edge, 0] + dirs[following, 0]
            y = dirs[edge, 1] + dirs[following, 1]
            z = dirs[edge, 2] + dirs[following, 2]
            inverse = np.float32(1) / math.sqrt(x * x + y * y + z * z)
            dirs[3 + edge, 0], dirs[3 + edge, 1], dirs[3 + edge, 2] = x * inverse, y * inverse, z * inverse
        bend = np.float32(0)
        for k in range(num_curves):
            g = own_gamma[k, :, 0]
            for corner in range(3):
                g[corner] = stack_gamma[top, k, corner]
            ox, oy, oz = scaled_wo[k, 0], scaled_wo[k, 1], scaled_wo[k, 2]
            for node in range(3, 6):
                g[node] = scale[k] * angle_at(kinds[k], dirs[node, 0], dirs[node, 1], dirs[node, 2], ox, oy, oz)
            bend = max(bend, _bend_of(g[0], g[1], g[2], g[3], g[4], g[5]))
        share = _QUARTER**level
        if bend <= 1:
            leaves[:, :, num] = own_gamma[:, :3, 0]
            shares[num] = share
            num += 1
        elif bend <= _QUARTERED_BEND or level == _MAX_DEPTH - 1:
            num = _quarter(own_gamma, 0, share, leaves, shares, num)
        else:
            for child in range(4):
                for corner in range(3):
                    node = _CHILDREN[child, corner]
                    for axis in range(3):
                        stack[top + child, corner, axis] = dirs[node, axis]
                    for k in range(num_curves):
                        stack_gamma[top + child, k, corner] = own_gamma[k, node, 0]
                depth[top + child] = level + 1
            top += 4
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _multiply_means(corner, bands, num_bands, is_gray, num, weight):  # type: ignore[no-untyped-def]
    """Multiply the weights (3, n) of leaves by the mean of a dormant curve over each.

    Args:
        corner: the angle at the leaves' corners, in bands. (3, n). bands: of the curve. (≥ num_bands, 3)
        is_gray: the curve is the same in all channels.
    """
    last = np.uint64(num_bands - 1)
    for n in range(num):
        low, middle, high, rise, fall, rest = overlap_of(corner[0, n], corner[1, n], corner[2, n])
        first_band, last_band = min(np.uint64(low), last), min(np.uint64(high), last)
        below = red = green = blue = np.float32(0)
        for j in range(first_band, last_band):
            upto = area_below(np.float32(j + np.uint64(1)), low, middle, high, rise, fall, rest)
            red += (upto - below) * bands[j, 0]
            if not is_gray:
                green += (upto - below) * bands[j, 1]
                blue += (upto - below) * bands[j, 2]
            below = upto
        rest = np.float32(1) - below
        red += rest * bands[last_band, 0]
        weight[0, n] *= red
        weight[1, n] *= red if is_gray else green + rest * bands[last_band, 1]
        weight[2, n] *= red if is_gray else blue + rest * bands[last_band, 2]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _deposit(corner, num_bands, num, weight, out):  # type: ignore[no-untyped-def]
    """Share leaves out to the bands of the free curve (eq. 22). corner: (3, n), weight: (3, n), out: (J, 3)."""
    last = np.uint64(num_bands - 1)
    for n in range(num):
        low, middle, high, rise, fall, rest = overlap_of(corner[0, n], corner[1, n], corner[2, n])
        first_band, last_band = min(np.uint64(low), last), min(np.uint64(high), last)
        red, green, blue = weight[0, n], weight[1, n], weight[2, n]
        below = np.float32(0)
        for j in range(first_band, last_band):
            upto = area_below(np.float32(j + np.uint64(1)), low, middle, high, rise, fall, rest)
            out[j, 0] += (upto - below) * red
            out[j, 1] += (upto - below) * green
            out[j, 2] += (upto - below) * blue
            below = upto
        rest = np.float32(1) - below
        out[last_band, 0] += rest * red
        out[last_band, 1] += rest * green
        out[last_band, 2] += rest * blue


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _spend(leaves, num, num_bands, bands, is_gray, active, weight, out):  # type: ignore[no-untyped-def]
    """Weigh the leaves by the dormant curves and share them out."""
    for k in range(leaves.shape[0]):
        if k != active:
            _multiply_means(leaves[k], bands[k], num_bands[k], is_gray[k], num, weight)
    if active >= 0:
        _deposit(leaves[active], num_bands[active], num, weight, out)
        return
    for channel in range(3):
        total = np.float32(0)
        for n in range(num):
            total += weight[channel, n]
        out[0, channel] += total


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _weigh(power, light, shading, begin, of_entry, shares, num, weight):  # type: ignore[no-untyped-def]
    """Light of each leaf: power · q cos θi · its share of the triangle. weight: (3, n), written."""
    for n in range(num):
        entry = begin + of_entry[n]
        m = np.uint64(light[entry])
        value = shading[entry] * shares[n]
        weight[0, n] = power[m, 0] * value
        weight[1, n] = power[m, 1] * value
        weight[2, n] = power[m, 2] * value


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def project_points(  # type: ignore[no-untyped-def]
    normal, tangent, first, light, shading, local_wo, nodes, power,
    kinds, axes, num_bands, bands, is_gray, support, active, start, stop, out,
):  # fmt: skip
    """Project points [start, stop); `first`, `light`, `shading` (q · cos θi) and `local_wo` list their visible lights.

    out: (points, J, 3) float32, added to.
    """
    num_curves, num_lights = kinds.shape[0], nodes.shape[2]
    scale = np.empty(num_curves, np.float32)
    for k in range(num_curves):
        scale[k] = num_bands[k] / (np.pi / 2)
    local = np.empty((3, 6, num_lights), np.float32)
    gamma = np.empty((num_curves, 6, num_lights), np.float32)
    capacity = num_lights + 2 * 4**_MAX_DEPTH
    leaves = np.empty((num_curves, 3, capacity), np.float32)
    shares, of_entry = np.empty(capacity, np.float32), np.empty(capacity, np.int64)
    weight, bend = np.empty((3, capacity), np.float32), np.empty(num_lights, np.float32)
    bent = np.empty(num_lights, np.int64)
    stack, depth = np.empty((3 * _MAX_DEPTH + 4, 3, 3), np.float32), np.empty(3 * _MAX_DEPTH + 4, np.int64)
    stack_gamma = np.empty((3 * _MAX_DEPTH + 4, num_curves, 3), np.float32)
    dirs, own_gamma = np.empty((6, 3), np.float32), np.empty((num_curves, 6, 1), np.float32)
    scaled_wo = np.empty((num_curves, 3), np.float32)
    one = np.float32(1)
    for p in range(start, stop):
        row = p - start
        begin, end = first[row], first[row + 1]
        if begin == end:
            continue
        if num_curves > 0:
            _turn_nodes(normal[p], tangent[p], nodes, light, begin, end, local)
        for k in range(num_curves):
            for axis in range(3):
                scaled_wo[k, axis] = axes[k, axis] * local_wo[axis, begin]
            for node in range(6):
                angles_into(
                    kinds[k], scale[k], local[0, node, : end - begin], local[1, node, : end - begin],
                    local[2, node, : end - begin], scaled_wo[k, 0], scaled_wo[k, 1], scaled_wo[k, 2], gamma[k, node],
                )  # fmt: skip
        _bends(gamma, support, end - begin, bend)
        num, num_bent = _gather_linear(gamma, end - begin, bend, leaves, shares, of_entry, bent)
        for b in range(num_bent):
            entry = bent[b]
            if num + 4**_MAX_DEPTH > capacity:
                _weigh(power, light, shading, begin, of_entry, shares, num, weight)
                _spend(leaves, num, num_bands, bands, is_gray, active, weight, out[row])
                num = 0
            before = num
            if bend[entry] <= _QUARTERED_BEND:
                num = _quarter(gamma, entry, one, leaves, shares, num)
            else:
                num = _divide(
                    kinds, scale, scaled_wo, local, gamma, entry,
                    stack, stack_gamma, depth, dirs, own_gamma, leaves, shares, num,
                )  # fmt: skip
            of_entry[before:num] = entry
        _weigh(power, light, shading, begin, of_entry, shares, num, weight)
        _spend(leaves, num, num_bands, bands, is_gray, active, weight, out[row])
