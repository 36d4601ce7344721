"""Links: which cell each gather ray of a point hits. A pixel, a vertex or a cell may own the point."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_ranges
from relume.trace.cell_tree import NO_CELL, CellTree, locate
from relume.trace.cells import face_normals
from relume.trace.embree import aligned, intersect16, packet_arguments
from relume.trace.gather_rays import Pattern, local_ray, shift_of
from relume.trace.geometry import Geometry

F32 = NDArray[np.float32]

_FLOATS_A_PACKET = 12 * 16 + 9 * 16  # RTCRay16, then RTCHit16 with its instance ids
_NEAR, _FAR, _MASK = 3, 8, 9
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


@nb.njit(nogil=True, cache=True, inline="always")
def _turned(frame, x, y, z):  # type: ignore[no-untyped-def]
    """A local direction in world space. frame: tangent, bitangent, normal, three components each"""
    t, b, n = frame
    return t[0] * x + b[0] * y + n[0] * z, t[1] * x + b[1] * y + n[1] * z, t[2] * x + b[2] * y + n[2] * z


@nb.njit(nogil=True, cache=True)
def _cell_of(packet, words, lane, surfaces, tree):  # type: ignore[no-untyped-def]
    """The cell that the ray of a lane has hit."""
    if words[_GEOMETRY * 16 + lane] == _NOTHING:
        return np.int32(NO_CELL)
    normals, meshes = surfaces
    face = words[_PRIMITIVE * 16 + lane]
    nx, ny, nz = normals[face, 0], normals[face, 1], normals[face, 2]
    side = 2 * meshes[face]
    far = packet[_FAR * 16 + lane]
    dx, dy, dz = packet[4 * 16 + lane], packet[5 * 16 + lane], packet[6 * 16 + lane]
    if nx * dx + ny * dy + nz * dz > 0:
        nx, ny, nz, side = -nx, -ny, -nz, side + 1
    x, y, z = packet[lane] + far * dx, packet[16 + lane] + far * dy, packet[32 + lane] + far * dz
    return locate(tree, side, x, y, z, nx, ny, nz)


@nb.njit(nogil=True, cache=True)
def _trace(  # type: ignore[no-untyped-def]
    intersect, scene, arguments, points, surfaces, tree, pattern, numbers, start, stop, links
):
    """Trace all rays of points [start, stop); returns how many.

    points: position, normal, tangent, wo. surfaces: normal and mesh of each face.
    """
    position, normal, tangent, towards = points
    packet = aligned(_FLOATS_A_PACKET)
    words = packet.view(np.uint32)
    words[_MASK * 16 : (_MASK + 1) * 16] = _NOTHING
    valid = aligned(16).view(np.int32)
    ray_of = np.empty(16, np.int64)
    num_rays = 0
    for p in range(start, stop):
        n, t, wo = normal[p], tangent[p], towards[p]
        b = (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])
        frame = ((t[0], t[1], t[2]), b, (n[0], n[1], n[2]))
        ox = t[0] * wo[0] + t[1] * wo[1] + t[2] * wo[2]
        oy = b[0] * wo[0] + b[1] * wo[1] + b[2] * wo[2]
        oz = n[0] * wo[0] + n[1] * wo[1] + n[2] * wo[2]
        shift_u, shift_v = shift_of(pattern, numbers[p])
        for axis in range(3):
            packet[axis * 16 : (axis + 1) * 16] = position[p, axis]
        links[p] = NO_CELL
        ray = 0
        while ray < links.shape[1]:
            lanes = 0
            while ray < links.shape[1] and lanes < 16:
                x, y, z = local_ray(pattern, ray, shift_u, shift_v, ox, oy, oz)
                if z > 0:
                    dx, dy, dz = _turned(frame, x, y, z)
                    packet[4 * 16 + lanes], packet[5 * 16 + lanes], packet[6 * 16 + lanes] = dx, dy, dz
                    ray_of[lanes] = ray
                    lanes += 1
                ray += 1
            for k in range(16):
                valid[k] = -1 if k < lanes else 0
            packet[_NEAR * 16 : (_NEAR + 1) * 16] = 0
            packet[_FAR * 16 : (_FAR + 1) * 16] = np.inf
            words[_GEOMETRY * 16 : (_GEOMETRY + 2) * 16] = _NOTHING
            intersect(np.int64(valid.ctypes.data), scene, np.int64(packet.ctypes.data), arguments)
            num_rays += lanes
            for k in range(lanes):
                links[p, ray_of[k]] = _cell_of(packet, words, k, surfaces, tree)
    return num_rays


def trace_links(
    geometry: Geometry, tree: CellTree, points: Gatherers, pattern: Pattern, numbers: NDArray[np.uint32]
) -> Links:
    """Trace all rays of points.

    Args:
        numbers: of the points among all that share the pattern; they decide their shifts. (n,) uint32
    Cost: O(n · rays · (log triangles + log cells)) time.
    """
    links = np.empty((len(points.position), len(pattern.uv)), np.uint16)
    arguments = packet_arguments(coherent=False)
    surfaces = face_normals(geometry), geometry.face_mesh
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
