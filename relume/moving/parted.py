"""Light of points that something stands before: pixels take it from those of the points about them that they see.

A floor goes on under what stands on it and behind walls. The three nodes about a pixel may lie on both sides of a wall,
and those beyond it know other light, or none. So nodes that do not see their neighbours in the grid of a face are found
once; pixels about them look for each of their three nodes, from as little above the surface, and do without those that
they do not see. Where a pixel sees none, it takes all three. Faces that have no more nodes than corners are left alone:
what is that fine is curved, and hides a node from the next by itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.look_up import Seen
from relume.moving.points.grids import Lattice, node_of
from relume.moving.solid import Solid
from relume.parallel import for_ranges, for_shares
from relume.trace.embree import occluded, packet_arguments
from relume.trace.packet import LANES, aim, ask_first, is_free, new_packet, set_origin, trace_shadows
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_FACES_A_RANGE = 256
_RAYS = LANES // 3  # whose three nodes are looked for at once


class _Grids(NamedTuple):
    """Grids of faces, as kernels want them; see `Solid`."""

    lattice: Lattice
    positions: F32
    faces: NDArray[np.uint32]
    face_normal: F32
    off_edges: F32
    off_surface: np.float32


@nb.njit(nogil=True, cache=True, inline="always")
def _place(grids, f, side, u, v, at):  # type: ignore[no-untyped-def]
    """Find a place in a face, off its surface and its edges, where it would lie in other faces. at: (3,)"""
    w = max(np.float32(1) - u - v, grids.off_edges[f, 0])
    u, v = max(np.float32(u), grids.off_edges[f, 1]), max(np.float32(v), grids.off_edges[f, 2])
    a, b, c = grids.faces[f, 0], grids.faces[f, 1], grids.faces[f, 2]
    lift = -grids.off_surface if side == 1 else grids.off_surface
    for axis in range(3):
        x, y, z = grids.positions[a, axis], grids.positions[b, axis], grids.positions[c, axis]
        at[axis] = (w * x + u * y + v * z) / (w + u + v) + lift * grids.face_normal[f, axis]


@nb.njit(nogil=True, cache=True, inline="always")
def _join(packet, lane, start, end):  # type: ignore[no-untyped-def]
    """Send a lane from one place to another."""
    set_origin(packet, lane, start[0], start[1], start[2])
    aim(packet, lane, end[0] - start[0], end[1] - start[1], end[2] - start[2], np.float32(1))


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _flush(occluded, packet, waiting, ends, is_parted):  # type: ignore[no-untyped-def]
    """Trace the first lanes, and note both ends of what is blocked. ends: vertices. (`LANES`, 2)"""
    ask_first(packet, waiting)
    trace_shadows(occluded, packet)
    for lane in range(waiting):
        if not is_free(packet, lane):
            is_parted[ends[lane, 0]] = is_parted[ends[lane, 1]] = 1


@nb.njit(nogil=True, cache=True)
def _part(occluded, scene, arguments, grids, start, stop, is_parted):  # type: ignore[no-untyped-def]
    """Look along all edges of the grids of faces [start, stop)."""
    packet, ends, waiting = new_packet(scene, arguments), np.empty((LANES, 2), np.uint32), 0
    here, there = np.empty(3, np.float32), np.empty(3, np.float32)
    for f in range(start, stop):
        for side in range(2):
            rows, first = np.int64(grids.lattice.num_rows[f, side]), np.int64(grids.lattice.first[f, side])
            for i in range(rows if rows > 1 else 0):
                for j in range(rows - i):
                    for edge in range(3):  # of the small triangle that begins here
                        i0, j0 = (i + 1, j) if edge == 2 else (i, j)
                        i1, j1 = (i + 1, j) if edge == 0 else (i, j + 1)
                        _place(grids, f, side, i0 / rows, j0 / rows, here)
                        _place(grids, f, side, i1 / rows, j1 / rows, there)
                        _join(packet, waiting, here, there)
                        ends[waiting, 0] = grids.lattice.node[first + node_of(rows, i0, j0)]
                        ends[waiting, 1] = grids.lattice.node[first + node_of(rows, i1, j1)]
                        waiting += 1
                        if waiting == LANES:
                            _flush(occluded, packet, waiting, ends, is_parted)
                            waiting = 0
    if waiting:
        _flush(occluded, packet, waiting, ends, is_parted)


def find_parted(solid: Solid) -> NDArray[np.uint8]:
    """Find the vertices that do not see all of their neighbours in the grids of faces. (vertices,) uint8"""
    surface, arguments = solid.surface, packet_arguments(coherent=True)
    is_parted = np.zeros(len(surface.vertices.normal), np.uint8)
    args = occluded, solid.embree.handle, arguments.ctypes.data, _grids_of(solid)
    # threads may note one twice
    for_ranges(lambda start, stop: _part(*args, start, stop, is_parted), len(surface.faces), _FACES_A_RANGE)
    return is_parted


def _grids_of(solid: Solid) -> _Grids:
    surface = solid.surface
    of_faces = surface.faces, surface.face_normal, solid.off_edges
    return _Grids(surface.lattice, solid.positions, *of_faces, np.float32(solid.off_surface))


@nb.njit(nogil=True, cache=True, inline="always")
def _cell(rows, u, v):  # type: ignore[no-untyped-def]
    """Find the small triangle that a place in a face lies in: i and j of its first node, whether it is turned round.

    Its nodes are (i, j), (i + 1, j), (i, j + 1), or (i + 1, j + 1) instead of the first: in the order of `Seen.vertex`.
    """
    i = min(max(np.int64(u * np.float32(rows)), 0), rows - 1)
    j = min(max(np.int64(v * np.float32(rows)), 0), rows - 1 - i)
    is_turned = u * np.float32(rows) - i + (v * np.float32(rows) - j) > 1 and i + j < rows - 1
    return i, j, is_turned


@nb.njit(nogil=True, cache=True)
def _mend(occluded, scene, arguments, grids, is_parted, face, uv, directions, vertex, start, stop, weight):  # type: ignore[no-untyped-def]
    """Look for the nodes of rays [start, stop) about which some are parted."""
    packet, waiting = new_packet(scene, arguments), 0
    here, there, normals = np.empty(3, np.float32), np.empty(3, np.float32), grids.face_normal
    for p in range(start, stop):
        f = face[p]
        if f < 0 or not (is_parted[vertex[p, 0]] or is_parted[vertex[p, 1]] or is_parted[vertex[p, 2]]):
            continue
        side = 0
        if normals[f, 0] * directions[p, 0] + normals[f, 1] * directions[p, 1] + normals[f, 2] * directions[p, 2] > 0:
            side = 1
        rows = np.int64(grids.lattice.num_rows[f, side])
        if rows == 0:
            rows = np.int64(grids.lattice.num_rows[f, 1 - side])
        if rows < 2:
            continue
        i, j, is_turned = _cell(rows, uv[p, 0], uv[p, 1])
        _place(grids, f, side, uv[p, 0], uv[p, 1], here)
        for k in range(3):
            turned = 1 if is_turned and k == 0 else 0
            a, b = i + (1 if k == 1 else turned), j + (1 if k == 2 else turned)
            _place(grids, f, side, a / rows, b / rows, there)
            _join(packet, 3 * waiting + k, here, there)
        packet.owner[waiting] = p
        waiting += 1
        if waiting == _RAYS:
            _weigh(occluded, packet, waiting, weight)
            waiting = 0
    if waiting:
        _weigh(occluded, packet, waiting, weight)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _weigh(occluded, packet, waiting, weight):  # type: ignore[no-untyped-def]
    """Trace three lanes for each ray that waits; weights of nodes that are not seen become nothing."""
    ask_first(packet, 3 * waiting)
    trace_shadows(occluded, packet)
    for r in range(waiting):
        p, total = packet.owner[r], np.float32(0)
        for k in range(3):
            total += weight[p, k] if is_free(packet, 3 * r + k) else np.float32(0)
        for k in range(3):
            if total > 0:
                weight[p, k] = weight[p, k] / total if is_free(packet, 3 * r + k) else np.float32(0)


def mend(seen: Seen, is_parted: NDArray[np.uint8], solid: Solid) -> None:
    """Let rays do without the nodes that what they hit does not see.

    Args:
        seen: by an eye; its weights are changed. is_parted: from `find_parted`. (vertices,) uint8
        solid: that is seen.
    """
    if not is_parted.any():
        return
    arguments, hits = packet_arguments(coherent=False), seen.hits
    args = (
        occluded, solid.embree.handle, arguments.ctypes.data, _grids_of(solid), is_parted, hits.face, hits.uv,
        seen.directions, seen.vertex,
    )  # fmt: skip
    for_shares(lambda start, stop: _mend(*args, start, stop, seen.weight), len(hits.face))
