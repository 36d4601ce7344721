"""The kernel that lists lamps of some extent as light triangles: those parts of them that a point sees.

A part that is seen as a whole and no wider than `_NARROW` is two triangles; what is wider, or partly hidden, is divided
along its halvings (`relume.light.strata`), down to single samples.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np

from relume.light.gather_rays import shift_of
from relume.light.local import light_sample
from relume.light.strata import NOT_FLAT
from relume.project.gathered_kernel import in_frame
from relume.project.light_culling import keep_near
from relume.uncounted import UNCOUNTED

_ZERO, _HALF, _ONE = np.float32(0), np.float32(0.5), np.float32(1)
_THIRD, _TWO = np.float32(1 / 3), np.float32(2)
_PI = np.float32(math.pi)
_NARROW = np.float32(0.12)  # radians, to the farthest corner: what cosines vary over it is a hundredth
_NOT_FLAT = np.float32(NOT_FLAT)
_NOTHING = np.float32(1e-6)  # as a share of a part: a corner is a triangle's where it is two of four


@nb.njit(nogil=True, cache=True, inline="always")
def _num_seen(bits, first, count):  # type: ignore[no-untyped-def]
    """Count the samples [first, first + count) that are seen, count a power of four."""
    if count < 8:
        few: Any = np.int64(bits[first >> 3]) >> (first & 7)
        return (few & 1) + ((few >> 1 & 1) + (few >> 2 & 1) + (few >> 3 & 1) if count == 4 else 0)
    found = 0
    for place in range(first >> 3, (first + count) >> 3):
        byte: Any = np.int64(bits[place])
        byte = (byte & 0x55) + (byte >> 1 & 0x55)
        byte = (byte & 0x33) + (byte >> 2 & 0x33)
        found += (byte & 0x0F) + (byte >> 4)
    return found


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _square(x, y, z, nx, ny, nz, half, corner):  # type: ignore[no-untyped-def]
    """Lay a square about a place, across a normal. half: of its side. corner: written. (4, 3)"""
    length = math.sqrt(max(nx * nx + nz * nz, ny * ny + nz * nz))
    ex, ey, ez = (nz, _ZERO, -nx) if abs(nx) > abs(ny) else (_ZERO, nz, -ny)
    along = half / max(length, np.float32(1e-20))
    ex, ey, ez = ex * along, ey * along, ez * along
    fx, fy, fz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
    for k in range(4):
        s = _ONE if k in (1, 2) else -_ONE
        t = _ONE if k >= 2 else -_ONE
        corner[k, 0], corner[k, 1], corner[k, 2] = x + s * ex + t * fx, y + s * ey + t * fy, z + s * ez + t * fz


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _unit(x, y, z):  # type: ignore[no-untyped-def]
    inverse = _ONE / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-30)))
    return x * inverse, y * inverse, z * inverse


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _nodes(corner, second, node):  # type: ignore[no-untyped-def]
    """Find the directions of a triangle's corners, 0, `second` and the next of four, and of its edges' middles.

    Args:
        corner: seen from the point, metres. (4, 3) node: written. (6, 3)
    """
    for k in range(3):
        of = 0 if k == 0 else second + k - 1
        node[k, 0], node[k, 1], node[k, 2] = _unit(corner[of, 0], corner[of, 1], corner[of, 2])
    for k in range(3):
        to = (k + 1) % 3
        x, y, z = node[k, 0] + node[to, 0], node[k, 1] + node[to, 1], node[k, 2] + node[to, 2]
        node[3 + k, 0], node[3 + k, 1], node[3 + k, 2] = _unit(x, y, z)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _radius(x, y, z, node):  # type: ignore[no-untyped-def]
    """Find the angle from a direction to the farthest of a triangle's corners."""
    most = _ZERO
    for k in range(3):
        dx, dy, dz = node[k, 0] - x, node[k, 1] - y, node[k, 2] - z
        most = max(most, dx * dx + dy * dy + dz * dz)
    return _TWO * math.asin(min(_HALF * math.sqrt(most), _ONE))


# What is inlined takes arrays of the lamp, which a call would count references to: threads share them, and a list of
# parts took twice as long.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _add_halves(frame, corner, normal, share, area, gain, is_two_sided, made, end, light, wi, nodes, brings):  # type: ignore[no-untyped-def]
    """Add the two triangles of a quadrilateral.

    Args:
        frame: tangent, n × t, normal of the point. (3, 3) corner: seen from there, metres. (4, 3)
        normal: of the lamp there. (3,) share: of the first in its light. area: that it stands for, m².
        gain: (3,). made, end: of triangles and entries so far.
        light, wi, nodes, brings: written, see `list_lamp`.
    Returns:
        made and end, afterwards.
    """
    for half in range(2):
        part = area * (share if half == 0 else _ONE - share)
        if part <= _NOTHING * area:
            continue
        x = _THIRD * (corner[0, 0] + corner[1 + half, 0] + corner[2 + half, 0])
        y = _THIRD * (corner[0, 1] + corner[1 + half, 1] + corner[2 + half, 1])
        z = _THIRD * (corner[0, 2] + corner[1 + half, 2] + corner[2 + half, 2])
        squared = x * x + y * y + z * z
        x, y, z = _unit(x, y, z)
        cosine = -(x * normal[0] + y * normal[1] + z * normal[2])
        cosine = abs(cosine) if is_two_sided else cosine
        up = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z
        if cosine <= 0 or up <= 0:
            continue
        _nodes(corner, 1 + half, nodes[made])
        weight = part * cosine / max(squared, part / _PI)
        for channel in range(3):
            brings[made, channel] = weight * gain[channel]
        brings[made, 3] = _radius(x, y, z, nodes[made])
        light[end] = made
        wi[0, end] = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z
        wi[1, end] = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
        wi[2, end] = up
        made, end = made + 1, end + 1
    return made, end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _outline(light, strata, parts, part, sample, shift, x, y, z, area, corner, across):  # type: ignore[no-untyped-def]
    """Find the quadrilateral that stands for a part.

    Args:
        light, strata, parts: of the lamp. part: number of the part. sample: its only one, if it does not lie flat.
        shift: of the point. x, y, z: the point. area: that the part stands for, m².
        corner: seen from the point, written. (4, 3) across: normal of the lamp there, written. (3,)
    Returns:
        The share of its first triangle.
    """
    if parts.radius[part] < _NOT_FLAT:
        for k in range(4):
            corner[k, 0] = parts.corners[part, k, 0] - x
            corner[k, 1] = parts.corners[part, k, 1] - y
            corner[k, 2] = parts.corners[part, k, 2] - z
        across[0], across[1], across[2] = parts.normal[part, 0], parts.normal[part, 1], parts.normal[part, 2]
        return parts.share[part]
    # a sample of several pieces stands for so much about it
    dx, dy, dz, distance, _, nx, ny, nz = light_sample(light, strata, sample, shift[0], shift[1], x, y, z)
    across[0], across[1], across[2] = nx, ny, nz
    _square(distance * dx, distance * dy, distance * dz, nx, ny, nz, _HALF * math.sqrt(area), corner)
    return _HALF


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _list_parts(  # type: ignore[no-untyped-def]
    frame, place, shift, bits, lamp, scratch, made, end, light, wi, nodes, brings
):
    """List the parts that a point sees; returns triangles and entries so far.

    Args:
        frame: as in `_add_halves`. place: of the point. (3,) shift: of its samples. bits: which of them it sees.
        lamp: light, strata, parts and gain, as in `LocalRays`. scratch: from `_scratch`.
        made, end, light, wi, nodes, brings: as in `_add_halves`.
    """
    light_of, strata, parts, gain = lamp
    corner, across, waiting = scratch
    x, y, z = place[0], place[1], place[2]
    num, num_waiting = strata.uv.shape[0], 1
    waiting[0, 0] = waiting[0, 1] = 0
    while num_waiting > 0:
        num_waiting -= 1
        level, index = waiting[num_waiting, 0], waiting[num_waiting, 1]
        count = num >> (2 * level)
        seen = _num_seen(bits, index * count, count)
        if seen == 0:
            continue
        part = ((1 << (2 * level)) - 1) // 3 + index
        mx, my, mz = parts.middle[part, 0] - x, parts.middle[part, 1] - y, parts.middle[part, 2] - z
        width = parts.radius[part]
        is_narrow = width * width <= _NARROW * _NARROW * (mx * mx + my * my + mz * mz)
        if count > 1 and (seen < count or not is_narrow):
            for child in range(4):
                waiting[num_waiting, 0], waiting[num_waiting, 1] = level + 1, 4 * index + child
                num_waiting += 1
            continue
        area = light_of.area / np.float32(1 << (2 * level))
        share = _outline(light_of, strata, parts, part, index, shift, x, y, z, area, corner, across)
        made, end = _add_halves(
            frame, corner, across, share, area, gain, light_of.is_two_sided, made, end, light, wi, nodes, brings
        )
    return made, end


@nb.njit(nogil=True, cache=True)
def _scratch():  # type: ignore[no-untyped-def]
    """Make room for corners, a normal, and the parts that wait for their turn: three more at each level."""
    return np.empty((4, 3), np.float32), np.empty(3, np.float32), np.empty((16, 2), np.int64)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def list_lamp(  # type: ignore[no-untyped-def]
    points, wo, lamp, visible, kinds, support, start, stop, first, light, wi, out, nodes, brings
):
    """List what points [start, stop) see of a lamp.

    Args:
        points: `Points`. wo: towards the viewer. (n, 3) float32
        lamp: light, strata, parts and gain, as in `LocalRays`. visible: as there.
        kinds, support, first, light, wi, out: as of `relume.project.light_culling.list_lights`.
        nodes: of triangles, written, corners and midpoints of edges. (M, 6, 3) float32
        brings: their irradiance and, in radians, radius, written. (M, 4) float32
    Returns:
        K, the number of entries, and M, of triangles.
    """
    position, normal, tangent, seed, _ = points
    most = 2 * lamp[1].uv.shape[0]
    radius, reach, nearest = brings[:, 3], np.empty(most, np.float32), np.empty(most, np.float32)
    frame, scratch = np.empty((3, 3), np.float32), _scratch()
    made = end = np.int64(0)
    for p in range(start, stop):
        begin = end
        first[p - start] = begin
        (bx, by, bz), (ox, oy, oz) = in_frame(normal[p], tangent[p], wo[p])
        for axis in range(3):
            frame[0, axis], frame[2, axis] = tangent[p, axis], normal[p, axis]
        frame[1, 0], frame[1, 1], frame[1, 2] = bx, by, bz
        shift = shift_of(lamp[1], seed[p])
        made, end = _list_parts(
            frame, position[p], shift, visible[p], lamp, scratch, made, end, light, wi, nodes, brings
        )
        end = keep_near(kinds, support, radius, light, wi, begin, end, ox, oy, oz, reach, nearest)
        out[0, begin:end], out[1, begin:end], out[2, begin:end] = ox, oy, oz
    first[stop - start] = end
    return end, made
