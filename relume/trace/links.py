"""Links: which cell each gather ray of a point hits. A pixel, a vertex or a cell may own the point."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_ranges
from relume.trace.cell_tree import NO_CELL_NODE, CellTree, locate16
from relume.trace.cells import face_normals
from relume.trace.embree import aligned, intersect16, packet_arguments
from relume.trace.gather_rays import Pattern, cosine_ray, glossy_ray, small_shifts_of
from relume.trace.geometry import Geometry

F32 = NDArray[np.float32]

_FLOATS_A_PACKET = 12 * 16 + 9 * 16  # RTCRay16, then RTCHit16 with its instance ids
_NEAR, _DIRECTION, _FAR, _MASK = 3, 4, 8, 9
_PRIMITIVE, _GEOMETRY = 17, 18
_NOTHING = 0xFFFFFFFF
_POINTS_A_RANGE = 256


@dataclass(frozen=True)
class Gatherers:
    """Points that rays leave from.

    Attributes:
        position: off the surface already. normal, tangent: shading frame. wo: towards the viewer. (n, 3) float32
    """

    position: F32
    normal: F32
    tangent: F32
    wo: F32


@dataclass(frozen=True)
class Links:
    """Of n points.

    Attributes:
        cell: that each ray hits, `NO_CELL` where it leaves the scene or was not to be traced. (n, rays) uint16
        num_rays: traced. trace_s: wall time of the tracing alone.
    """

    cell: NDArray[np.uint16]
    num_rays: int
    trace_s: float


@nb.njit(nogil=True, cache=True)
def _enter(points, pattern, numbers, first, width, packet, frame, towards, shifts):  # type: ignore[no-untyped-def]
    """Begin with points [first, first + width): origins of their rays, local frames, shifts; one lane each.

    points: position, normal, tangent, wo. frame: tangent, bitangent, normal. (3, 3, 16) shifts: (2 sets, 4, 16)
    """
    position, normal, tangent, wo = points
    for k in range(16):
        p = first + min(k, width - 1)
        n, t, o = normal[p], tangent[p], wo[p]
        b = (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])
        for axis in range(3):
            packet[16 * axis + k] = position[p, axis]
            frame[0, axis, k], frame[1, axis, k], frame[2, axis, k] = t[axis], b[axis], n[axis]
        for row in range(3):
            towards[row, k] = frame[row, 0, k] * o[0] + frame[row, 1, k] * o[1] + frame[row, 2, k] * o[2]
        of_cosine, of_glossy = small_shifts_of(pattern, numbers[p])
        for m in range(4):
            shifts[0, m, k], shifts[1, m, k] = of_cosine[m], of_glossy[m]


@nb.njit(nogil=True, cache=True, fastmath=True)
def _aim(pattern, ray, frame, towards, shifts, packet, valid, width):  # type: ignore[no-untyped-def]
    """Aim the same ray of all lanes; returns how many of them are above their horizon."""
    of_ray, is_cosine = pattern.rays[ray], ray < pattern.num_cosine
    cosine, glossy = shifts[0], shifts[1]
    num_valid = 0
    for k in range(16):
        if is_cosine:
            x, y, z = cosine_ray(of_ray, (cosine[0, k], cosine[1, k], cosine[2, k], cosine[3, k]))
        else:
            shift = (glossy[0, k], glossy[1, k], glossy[2, k], glossy[3, k])
            x, y, z = glossy_ray(of_ray, shift, towards[0, k], towards[1, k], towards[2, k])
        for axis in range(3):
            along = frame[0, axis, k] * x + frame[1, axis, k] * y + frame[2, axis, k] * z
            packet[(_DIRECTION + axis) * 16 + k] = along
        packet[_NEAR * 16 + k], packet[_FAR * 16 + k] = 0, np.inf
        is_above = z > 0 and k < width
        valid[k] = -1 if is_above else 0
        num_valid += is_above
    return num_valid


@nb.njit(nogil=True, cache=True, fastmath=True)
def _find(packet, words, surfaces, tree, keys, nodes):  # type: ignore[no-untyped-def]
    """The cells that the rays of all lanes have hit, into nodes. keys: (6, 16) float32"""
    normals, sides, roots = surfaces[0], surfaces[1], tree.roots
    for k in range(16):
        nodes[k] = NO_CELL_NODE
        if words[_GEOMETRY * 16 + k] == _NOTHING:
            continue
        face = words[_PRIMITIVE * 16 + k]
        far = packet[_FAR * 16 + k]
        along = np.float32(0)
        for axis in range(3):
            keys[axis, k] = packet[axis * 16 + k] + far * packet[(_DIRECTION + axis) * 16 + k]
            keys[3 + axis, k] = normals[face, axis]
            along += normals[face, axis] * packet[(_DIRECTION + axis) * 16 + k]
        is_behind = along > 0
        nodes[k] = roots[sides[face] + is_behind]
        if is_behind:
            for axis in range(3, 6):
                keys[axis, k] = -keys[axis, k]
    locate16(tree, keys, nodes)


@nb.njit(nogil=True, cache=True)
def _trace(  # type: ignore[no-untyped-def]
    intersect, scene, arguments, points, surfaces, tree, pattern, numbers, start, stop, links
):
    """Trace all rays of points [start, stop), the same ray of 16 points at once; returns how many.

    surfaces: normal, and number of the front side, of each face.
    """
    packet = aligned(_FLOATS_A_PACKET)
    words = packet.view(np.uint32)
    words[_MASK * 16 : (_MASK + 1) * 16] = _NOTHING
    valid = aligned(16).view(np.int32)
    frame, towards = np.empty((3, 3, 16), np.float32), np.empty((3, 16), np.float32)
    shifts, keys = np.empty((2, 4, 16), np.float32), np.zeros((6, 16), np.float32)
    cells = np.empty(16, np.int32)
    num_rays = 0
    for first in range(start, stop, 16):
        width = min(16, stop - first)
        _enter(points, pattern, numbers, first, width, packet, frame, towards, shifts)
        for ray in range(links.shape[1]):
            num_rays += _aim(pattern, ray, frame, towards, shifts, packet, valid, width)
            words[_GEOMETRY * 16 : (_GEOMETRY + 2) * 16] = _NOTHING
            intersect(np.int64(valid.ctypes.data), scene, np.int64(packet.ctypes.data), arguments)
            _find(packet, words, surfaces, tree, keys, cells)
            for k in range(width):
                links[first + k, ray] = cells[k]
    return num_rays


def trace_links(
    geometry: Geometry, tree: CellTree, points: Gatherers, pattern: Pattern, numbers: NDArray[np.uint32]
) -> Links:
    """Trace all rays of points.

    Args:
        numbers: of the points among all that share the pattern; they decide their shifts. (n,) uint32
    Cost: O(n · rays · (log triangles + log cells)) time.
    """
    links = np.empty((len(points.position), pattern.num_rays), np.uint16)
    arguments = packet_arguments(coherent=True)
    surfaces = face_normals(geometry), (2 * geometry.face_mesh).astype(np.int32)
    arrays = tuple(np.ascontiguousarray(a) for a in (points.position, points.normal, points.tangent, points.wo))
    counts: list[int] = []

    def kernel(start: int, stop: int) -> None:
        counts.append(
            _trace(
                intersect16, geometry.embree.handle, arguments.ctypes.data, arrays, surfaces, tree, pattern,
                numbers, start, stop, links,
            )
        )  # fmt: skip

    began = time.perf_counter()
    for_ranges(kernel, len(links), _POINTS_A_RANGE)
    return Links(links, sum(counts), time.perf_counter() - began)
