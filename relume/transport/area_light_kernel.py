"""Kernel that lists the visible parts of area lights as light triangles.

A fully visible part no wider than `_NARROW` becomes two triangles. A wider or partly occluded part is divided along its
halves (`relume.lights.light_sampling`), down to single samples.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.lights.light_sampling import NOT_FLAT_RADIUS, EmitterParts, LightStrata
from relume.lights.local_lights import LocalLight, light_sample
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.transport.gather_kernel import in_frame
from relume.transport.light_culling import cull

F32 = NDArray[np.float32]

_ZERO, _HALF, _ONE = np.float32(0), np.float32(0.5), np.float32(1)
_THIRD, _TWO = np.float32(1 / 3), np.float32(2)
_PI = np.float32(math.pi)
_NARROW = np.float32(0.12)  # radians, to the farthest corner: cosines vary over it by about 0.01
_NOT_FLAT = np.float32(NOT_FLAT_RADIUS)
_NOTHING = np.float32(1e-6)  # fraction of a part: a corner belongs to a triangle if it is two of its four


class AreaLight(NamedTuple):
    """A light with a surface: see `relume.transport.shading_points.LocalRays`. gain: on its unit emission."""

    light: LocalLight
    strata: LightStrata
    parts: EmitterParts
    gain: Shaped[F32, " 3"]


class AreaTriangles(NamedTuple):
    """Memory for the visible triangles of area lights.

    Attributes:
        nodes: unit directions of corners and edge midpoints.
        irradiance_radius: irradiance per channel and angular radius, radians.
    """

    nodes: Shaped[F32, "M 6 3"]
    irradiance_radius: Shaped[F32, "M 4"]


class _Scratch(NamedTuple):
    """Scratch memory of a thread.

    Attributes:
        frame: tangent, n × t, normal of the shaded point. cull: for `cull`.
        corner: of a quadrilateral, relative to the shaded point, meters. normal: of the light there.
        stack: levels and indices of parts, three more at each level.
    """

    frame: Shaped[F32, "3 3"]
    corner: Shaped[F32, "4 3"]
    normal: Shaped[F32, " 3"]
    stack: Shaped[NDArray[np.int64], "parts 2"]
    cull: Shaped[F32, "2 triangles"]


def allocate_scratch(max_triangles: int) -> _Scratch:
    """Allocate scratch memory for `list_area_light`. max_triangles: of a point."""
    frame, corner, normal = np.empty((3, 3), np.float32), np.empty((4, 3), np.float32), np.empty(3, np.float32)
    return _Scratch(frame, corner, normal, np.empty((16, 2), np.int64), np.empty((2, max_triangles), np.float32))


@nb.njit(nogil=True, cache=True, inline="always")
def _count_visible(bits, first, count):  # type: ignore[no-untyped-def]
    """Count the visible samples in [first, first + count); count is a power of four."""
    if count < 8:
        nibble: Any = np.int64(bits[first >> 3]) >> (first & 7)
        return (nibble & 1) + ((nibble >> 1 & 1) + (nibble >> 2 & 1) + (nibble >> 3 & 1) if count == 4 else 0)
    num_visible = 0
    for byte_index in range(first >> 3, (first + count) >> 3):
        byte: Any = np.int64(bits[byte_index])
        byte = (byte & 0x55) + (byte >> 1 & 0x55)
        byte = (byte & 0x33) + (byte >> 2 & 0x33)
        num_visible += (byte & 0x0F) + (byte >> 4)
    return num_visible


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _make_square(x, y, z, nx, ny, nz, half, corner):  # type: ignore[no-untyped-def]
    """Center a square at a point, perpendicular to a normal. half: half its side. corner: written. (4, 3)"""
    length = math.sqrt(max(nx * nx + nz * nz, ny * ny + nz * nz))
    ex, ey, ez = (nz, _ZERO, -nx) if abs(nx) > abs(ny) else (_ZERO, nz, -ny)
    along = half / max(length, np.float32(1e-20))
    ex, ey, ez = ex * along, ey * along, ez * along
    fx, fy, fz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
    for k in range(4):
        s = _ONE if k in (1, 2) else -_ONE
        t = _ONE if k >= 2 else -_ONE
        corner[k, 0], corner[k, 1], corner[k, 2] = x + s * ex + t * fx, y + s * ey + t * fy, z + s * ez + t * fz


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _unit(x, y, z):  # type: ignore[no-untyped-def]
    inverse = _ONE / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-30)))
    return x * inverse, y * inverse, z * inverse


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _triangle_nodes(corner, second, node):  # type: ignore[no-untyped-def]
    """Compute the directions of a triangle's corners (0, `second` and the next of four) and of its edge midpoints.

    Args:
        corner: relative to the shaded point, meters. (4, 3) node: written. (6, 3)
    """
    for k in range(3):
        corner_index = 0 if k == 0 else second + k - 1
        node[k, 0], node[k, 1], node[k, 2] = _unit(
            corner[corner_index, 0], corner[corner_index, 1], corner[corner_index, 2]
        )
    for k in range(3):
        next_corner = (k + 1) % 3
        x, y, z = (
            node[k, 0] + node[next_corner, 0],
            node[k, 1] + node[next_corner, 1],
            node[k, 2] + node[next_corner, 2],
        )
        node[3 + k, 0], node[3 + k, 1], node[3 + k, 2] = _unit(x, y, z)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _radius(x, y, z, node):  # type: ignore[no-untyped-def]
    """Return the angle from a direction to the farthest corner of a triangle."""
    max_squared = _ZERO
    for k in range(3):
        dx, dy, dz = node[k, 0] - x, node[k, 1] - y, node[k, 2] - z
        max_squared = max(max_squared, dx * dx + dy * dy + dz * dz)
    return _TWO * math.asin(min(_HALF * math.sqrt(max_squared), _ONE))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_halves(first_fraction, area, area_light, scratch, num_triangles, end, listed, triangles):  # type: ignore[no-untyped-def]
    """Add the two triangles of the quadrilateral in `scratch`.

    Args:
        first_fraction: fraction of the light in the first triangle. area: that the quadrilateral represents, m².
        num_triangles, end: triangles and entries so far. listed, triangles: written.
    Returns:
        The new num_triangles and end.
    """
    frame, corner, normal, wi = scratch.frame, scratch.corner, scratch.normal, listed.wi
    for half in range(2):
        triangle_area = area * (first_fraction if half == 0 else _ONE - first_fraction)
        if triangle_area <= _NOTHING * area:
            continue
        x = _THIRD * (corner[0, 0] + corner[1 + half, 0] + corner[2 + half, 0])
        y = _THIRD * (corner[0, 1] + corner[1 + half, 1] + corner[2 + half, 1])
        z = _THIRD * (corner[0, 2] + corner[1 + half, 2] + corner[2 + half, 2])
        squared = x * x + y * y + z * z
        x, y, z = _unit(x, y, z)
        cosine = -(x * normal[0] + y * normal[1] + z * normal[2])
        cosine = abs(cosine) if area_light.light.is_two_sided else cosine
        up = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z
        if cosine <= 0 or up <= 0:
            continue
        _triangle_nodes(corner, 1 + half, triangles.nodes[num_triangles])
        weight = triangle_area * cosine / max(squared, triangle_area / _PI)
        for channel in range(3):
            triangles.irradiance_radius[num_triangles, channel] = weight * area_light.gain[channel]
        triangles.irradiance_radius[num_triangles, 3] = _radius(x, y, z, triangles.nodes[num_triangles])
        listed.light[end] = num_triangles
        wi[0, end] = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z
        wi[1, end] = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
        wi[2, end] = up
        num_triangles, end = num_triangles + 1, end + 1
    return num_triangles, end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _outline(area_light, part_index, sample, shift, position, area, scratch):  # type: ignore[no-untyped-def]
    """Compute the quadrilateral that represents a part, in `scratch`.

    Args:
        part_index: index of the part. sample: its only sample, if the part is not flat.
        shift: sample offset of the shaded point. position: of that point. area: that the part represents, m².
    Returns:
        Fraction of the light in its first triangle.
    """
    parts, corner, normal = area_light.parts, scratch.corner, scratch.normal
    if parts.radius[part_index] < _NOT_FLAT:
        for axis in range(3):
            for k in range(4):
                corner[k, axis] = parts.corners[part_index, k, axis] - position[axis]
            normal[axis] = parts.normal[part_index, axis]
        return parts.first_fraction[part_index]
    # a sample that covers several pieces represents a square of its area
    dx, dy, dz, distance, _, nx, ny, nz, _ = light_sample(
        area_light.light, area_light.strata, sample, shift[0], shift[1], position[0], position[1], position[2]
    )
    normal[0], normal[1], normal[2] = nx, ny, nz
    _make_square(distance * dx, distance * dy, distance * dz, nx, ny, nz, _HALF * math.sqrt(area), corner)
    return _HALF


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _list_visible_parts(position, shift, bits, area_light, scratch, num_triangles, end, listed, triangles):  # type: ignore[no-untyped-def]
    """List the visible parts of an area light; return the triangles and entries so far.

    Args:
        position: of the point. (3,) shift: of its samples. bits: their visibility.
        num_triangles, end, listed, triangles: as in `_add_halves`.
    """
    parts, stack = area_light.parts, scratch.stack
    num, stack_size = area_light.strata.uv.shape[0], 1
    stack[0, 0] = stack[0, 1] = 0
    while stack_size > 0:
        stack_size -= 1
        level, index = stack[stack_size, 0], stack[stack_size, 1]
        count = num >> (2 * level)
        num_visible = _count_visible(bits, index * count, count)
        if num_visible == 0:
            continue
        part_index, squared_distance = ((1 << (2 * level)) - 1) // 3 + index, _ZERO
        for axis in range(3):
            squared_distance += (parts.center[part_index, axis] - position[axis]) ** 2
        is_narrow = parts.radius[part_index] ** 2 <= _NARROW * _NARROW * squared_distance
        if count > 1 and (num_visible < count or not is_narrow):
            for child in range(4):
                stack[stack_size, 0], stack[stack_size, 1] = level + 1, 4 * index + child
                stack_size += 1
            continue
        area = area_light.light.area / np.float32(1 << (2 * level))
        first_fraction = _outline(area_light, part_index, index, shift, position, area, scratch)
        num_triangles, end = _add_halves(
            first_fraction, area, area_light, scratch, num_triangles, end, listed, triangles
        )
    return num_triangles, end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def list_area_light(points, wo, area_light, visible, support, start, stop, scratch, listed, triangles):  # type: ignore[no-untyped-def]
    """List the parts of an area light that are visible from points [start, stop).

    Args:
        points: `SurfacePoints`. wo: view directions. (n, 3) float32
        area_light: `AreaLight`. visible: as in `LocalRays`. support: `CurveSupport`.
        scratch: from `allocate_scratch`. listed, triangles: `ListedLights` and `AreaTriangles`, written.
    Returns:
        K, the number of entries, and M, the number of triangles.
    """
    radius, frame, num_triangles, end = triangles.irradiance_radius[:, 3], scratch.frame, np.int64(0), np.int64(0)
    for p in range(start, stop):
        begin = end
        listed.first[p - start] = begin
        b, o = in_frame(points.normal[p], points.tangent[p], wo[p])
        for axis in range(3):
            frame[0, axis], frame[1, axis], frame[2, axis] = points.tangent[p, axis], b[axis], points.normal[p, axis]
        shift = cranley_patterson_offset(area_light.strata, points.seed[p])
        num_triangles, end = _list_visible_parts(
            points.position[p], shift, visible[p], area_light, scratch, num_triangles, end, listed, triangles
        )
        end = cull(support, radius, listed, begin, end, o, scratch.cull)
    listed.first[stop - start] = end
    return end, num_triangles
