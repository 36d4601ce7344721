"""Links: which cell each gather ray of a point hits. A pixel, a vertex or a cell may own the point."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.light.gather_rays import Pattern, cosine_ray, glossy_ray, small_shifts_of
from relume.parallel import for_ranges
from relume.points import Points
from relume.trace.cell_tree import NO_CELL_NODE, CellTree, locate
from relume.trace.embree import intersect, packet_arguments
from relume.trace.geometry import Geometry
from relume.trace.packet import (
    LANES,
    aim,
    ask,
    direction_of,
    hit_of,
    new_packet,
    place_of,
    set_origin,
    take_chance,
    trace_hits,
)
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_POINTS_A_RANGE = 256


@dataclass(frozen=True)
class Links:
    """What the rays of n points hit.

    Attributes:
        cell: that each ray hits, `NO_CELL` where it leaves the scene or was not to be traced. (n, rays) uint16
        num_rays: traced. trace_s: wall time of the tracing alone.
    """

    cell: NDArray[np.uint16]
    num_rays: int
    trace_s: float


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _enter(points, wo, pattern, first, width, packet, frame, towards, shifts):  # type: ignore[no-untyped-def]
    """Begin with points [first, first + width): origins of their rays, local frames, shifts; one lane each.

    wo: (n, 3). frame: tangent, bitangent, normal. (3, 3, `LANES`) shifts: (2 sets, 4, `LANES`)
    """
    position, normal, tangent, seed, chance = points
    for k in range(LANES):
        p = first + min(k, width - 1)
        n, t, o = normal[p], tangent[p], wo[p]
        b = (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])
        set_origin(packet, k, position[p, 0], position[p, 1], position[p, 2])
        take_chance(packet, k, chance[min(p, chance.shape[0] - 1)])
        for axis in range(3):
            frame[0, axis, k], frame[1, axis, k], frame[2, axis, k] = t[axis], b[axis], n[axis]
        for row in range(3):
            towards[row, k] = frame[row, 0, k] * o[0] + frame[row, 1, k] * o[1] + frame[row, 2, k] * o[2]
        of_cosine, of_glossy = small_shifts_of(pattern, seed[p])
        for m in range(4):
            shifts[0, m, k], shifts[1, m, k] = of_cosine[m], of_glossy[m]


@nb.njit(nogil=True, cache=True, fastmath=True, **UNCOUNTED)
def _aim(pattern, ray, frame, towards, shifts, packet, width):  # type: ignore[no-untyped-def]
    """Aim the same ray of all lanes; returns how many of them are above their horizon."""
    of_ray, is_cosine = pattern.rays[ray], ray < pattern.num_cosine
    cosine, glossy = shifts[0], shifts[1]
    num_valid = 0
    for k in range(LANES):
        if is_cosine:
            x, y, z = cosine_ray(of_ray, (cosine[0, k], cosine[1, k], cosine[2, k], cosine[3, k]))
        else:
            shift = (glossy[0, k], glossy[1, k], glossy[2, k], glossy[3, k])
            x, y, z = glossy_ray(of_ray, shift, towards[0, k], towards[1, k], towards[2, k])
        dx = frame[0, 0, k] * x + frame[1, 0, k] * y + frame[2, 0, k] * z
        dy = frame[0, 1, k] * x + frame[1, 1, k] * y + frame[2, 1, k] * z
        dz = frame[0, 2, k] * x + frame[1, 2, k] * y + frame[2, 2, k] * z
        aim(packet, k, dx, dy, dz, np.float32(np.inf))
        is_above = z > 0 and k < width
        ask(packet, k, is_above)
        num_valid += is_above
    return num_valid


@nb.njit(nogil=True, cache=True, fastmath=True, **UNCOUNTED)
def _find(packet, surfaces, tree, keys, nodes):  # type: ignore[no-untyped-def]
    """Find the cells that the rays of all lanes have hit, into nodes. (`LANES`,) int32. keys: scratch. (6, `LANES`)"""
    normals, sides, roots = surfaces[0], surfaces[1], tree.roots
    for k in range(LANES):
        nodes[k] = NO_CELL_NODE
        face, _ = hit_of(packet, k)
        if face < 0:
            continue
        away = np.float32(0)
        for axis in range(3):
            keys[axis, k] = place_of(packet, k, axis)
            keys[3 + axis, k] = normals[face, axis]
            away += normals[face, axis] * direction_of(packet, k, axis)
        is_behind = away > 0
        nodes[k] = roots[sides[face] + is_behind]
        if is_behind:
            for axis in range(3, 6):
                keys[axis, k] = -keys[axis, k]
    locate(tree, keys, nodes)


@nb.njit(nogil=True, cache=True)
def _trace(  # type: ignore[no-untyped-def]
    intersect, scene, arguments, points, wo, surfaces, tree, pattern, start, stop, links
):
    """Trace all rays of points [start, stop), the same ray of `LANES` points at once; returns how many.

    surfaces: normal, and number of the front side, of each face.
    """
    packet = new_packet(scene, arguments)
    frame, towards = np.empty((3, 3, LANES), np.float32), np.empty((3, LANES), np.float32)
    shifts, keys = np.empty((2, 4, LANES), np.float32), np.zeros((6, LANES), np.float32)
    cells = np.empty(LANES, np.int32)
    num_rays = 0
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        _enter(points, wo, pattern, first, width, packet, frame, towards, shifts)
        for ray in range(links.shape[1]):
            num_rays += _aim(pattern, ray, frame, towards, shifts, packet, width)
            trace_hits(intersect, packet)
            _find(packet, surfaces, tree, keys, cells)
            for k in range(width):
                links[first + k, ray] = cells[k]
    return num_rays


def trace_links(geometry: Geometry, tree: CellTree, points: Points, wo: F32, pattern: Pattern) -> Links:
    """Trace all rays of points.

    Args:
        geometry: the scene's triangles. tree: tells which cell a place on them belongs to.
        points: where rays leave; their seeds shift the pattern.
        wo: towards the viewer, unit, world space; glossy rays leave about its mirror direction. (n, 3) float32
        pattern: directions of the rays of every point.
    Returns:
        The cell of each ray, (n, `pattern.num_rays`) uint16, and what it cost.
    Cost: O(n · rays · (log triangles + log cells)) time.
    """
    links = np.empty((points.num_points, pattern.num_rays), np.uint16)
    arguments = packet_arguments(coherent=False)
    surfaces = geometry.face_normals, (2 * geometry.face_mesh).astype(np.int32)
    counts: list[int] = []

    def kernel(start: int, stop: int) -> None:
        counts.append(
            _trace(
                intersect, geometry.embree.handle, arguments.ctypes.data, points, wo, surfaces, tree, pattern,
                start, stop, links,
            )
        )  # fmt: skip

    began = time.perf_counter()
    for_ranges(kernel, len(links), _POINTS_A_RANGE)
    return Links(links, sum(counts), time.perf_counter() - began)
