"""Occlusion-aware interpolation: probes that are occluded from a pixel are excluded and the weights renormalized.

A floor continues under objects and behind walls. The three lattice nodes around a pixel may lie on both sides of a
wall, with different light on each side. Nodes that are occluded from a neighbor in the grid of a face are found once.
Pixels next to such nodes trace a ray to each of their three nodes, slightly above the surface, and exclude occluded
ones; if all are occluded, all are used. Faces without nodes besides their corners are skipped: such fine meshes are
curved, and occlude adjacent nodes by themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges, parallel_for_chunks
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.ray_scene import OcclusionMesh
from relume.probes.triangle_grids import ProbeGrid, node_index
from relume.raytrace.ray_origins import OriginMesh, ray_origin
from relume.raytrace.ray_packet import (
    LANES,
    enable_first_lanes,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)

F32 = NDArray[np.float32]

_FACES_PER_RANGE = 256
_RAYS_PER_PACKET = LANES // 3  # camera rays per packet, three nodes each


class _GridGeometry(NamedTuple):
    """Grids of faces, as arrays for kernels; see `OcclusionMesh`."""

    probe_grid: ProbeGrid
    origins: OriginMesh


@nb.njit(nogil=True, cache=True, inline="always")
def _point_on_face(geometry, f, side, u, v, point):  # type: ignore[no-untyped-def]
    """Write a point in a face, offset from its surface and edges, where it would lie in other faces. point: (3,)"""
    point[0], point[1], point[2] = ray_origin(geometry.origins, f, u, v, -1 if side == 1 else 1)


@nb.njit(nogil=True, cache=True, inline="always")
def _aim_between(packet, lane, start, end):  # type: ignore[no-untyped-def]
    """Aim a lane from one point at another."""
    set_origin(packet, lane, start[0], start[1], start[2])
    set_direction(packet, lane, end[0] - start[0], end[1] - start[1], end[2] - start[2], np.float32(1))


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _flush(packet, num_pending, ends, has_occluded_neighbor):  # type: ignore[no-untyped-def]
    """Trace the first lanes, and mark both ends of occluded ones. ends: nodes. (`LANES`, 2)"""
    enable_first_lanes(packet, num_pending)
    trace_shadows(packet)
    for lane in range(num_pending):
        if not is_unoccluded(packet, lane):
            has_occluded_neighbor[ends[lane, 0]] = has_occluded_neighbor[ends[lane, 1]] = 1


@nb.njit(nogil=True, cache=True)
def _mark_occluded(tracer, geometry, start, stop, has_occluded_neighbor):  # type: ignore[no-untyped-def]
    """Trace along all edges of the grids of faces [start, stop)."""
    packet, ends, num_pending = new_packet(tracer), np.empty((LANES, 2), np.uint32), np.int64(0)
    origin, target = np.empty(3, np.float32), np.empty(3, np.float32)
    for f in range(start, stop):
        for side in range(2):
            num_rows, first = (
                np.int64(geometry.probe_grid.num_rows[f, side]),
                np.int64(geometry.probe_grid.first[f, side]),
            )
            for i in range(num_rows if num_rows > 1 else 0):
                for j in range(num_rows - i):
                    for edge in range(3):  # of the grid triangle at (i, j)
                        i0, j0 = (i + 1, j) if edge == 2 else (i, j)
                        i1, j1 = (i + 1, j) if edge == 0 else (i, j + 1)
                        _point_on_face(geometry, f, side, i0 / num_rows, j0 / num_rows, origin)
                        _point_on_face(geometry, f, side, i1 / num_rows, j1 / num_rows, target)
                        _aim_between(packet, num_pending, origin, target)
                        ends[num_pending, 0] = geometry.probe_grid.node_index[first + node_index(num_rows, i0, j0)]
                        ends[num_pending, 1] = geometry.probe_grid.node_index[first + node_index(num_rows, i1, j1)]
                        num_pending += 1
                        if num_pending == LANES:
                            _flush(packet, num_pending, ends, has_occluded_neighbor)
                            num_pending = np.int64(0)
    if num_pending:
        _flush(packet, num_pending, ends, has_occluded_neighbor)


def find_occluded_probes(mesh: OcclusionMesh) -> Shaped[NDArray[np.uint8], " nodes"]:
    """Return nonzero for lattice nodes that are occluded from a neighbor in the grid of a face."""
    stored_scene = mesh.stored_scene
    has_occluded_neighbor = np.zeros(len(stored_scene.lattice_nodes.normal), np.uint8)
    args = mesh.embree.shadow_tracer(coherent=True), _grid_geometry(mesh)
    # threads may mark a node twice
    for_ranges(
        lambda start, stop: _mark_occluded(*args, start, stop, has_occluded_neighbor),
        len(stored_scene.faces),
        _FACES_PER_RANGE,
    )
    return has_occluded_neighbor


def _grid_geometry(mesh: OcclusionMesh) -> _GridGeometry:
    return _GridGeometry(mesh.stored_scene.probe_grid, mesh.origins)


@nb.njit(nogil=True, cache=True, inline="always")
def _grid_triangle(num_rows, u, v):  # type: ignore[no-untyped-def]
    """Return the grid triangle that contains a point of a face: i and j of its first node, and whether it is inverted.

    Its nodes are (i, j), (i + 1, j), (i, j + 1), or (i + 1, j + 1) instead of the first: in the order of
    `GBuffer.lattice_node`.
    """
    i = min(max(np.int64(u * np.float32(num_rows)), 0), num_rows - 1)
    j = min(max(np.int64(v * np.float32(num_rows)), 0), num_rows - 1 - i)
    is_inverted = u * np.float32(num_rows) - i + (v * np.float32(num_rows) - j) > 1 and i + j < num_rows - 1
    return i, j, is_inverted


@nb.njit(nogil=True, cache=True)
def _reweight(tracer, geometry, has_occluded_neighbor, gbuffer, start, stop):  # type: ignore[no-untyped-def]
    """Trace to the nodes of rays [start, stop) that have a node with an occluded neighbor."""
    packet, num_pending, (face, uv, _), directions = new_packet(tracer), np.int64(0), gbuffer.hits, gbuffer.directions
    lattice_node, weight = gbuffer.lattice_node, gbuffer.weight
    origin, target, normals = np.empty(3, np.float32), np.empty(3, np.float32), geometry.origins.normal
    for p in range(start, stop):
        f = face[p]
        if f < 0 or not (
            has_occluded_neighbor[lattice_node[p, 0]]
            or has_occluded_neighbor[lattice_node[p, 1]]
            or has_occluded_neighbor[lattice_node[p, 2]]
        ):
            continue
        side = 0
        if normals[f, 0] * directions[p, 0] + normals[f, 1] * directions[p, 1] + normals[f, 2] * directions[p, 2] > 0:
            side = 1
        num_rows = np.int64(geometry.probe_grid.num_rows[f, side])
        if num_rows == 0:
            num_rows = np.int64(geometry.probe_grid.num_rows[f, 1 - side])
        if num_rows < 2:
            continue
        i, j, is_inverted = _grid_triangle(num_rows, uv[p, 0], uv[p, 1])
        _point_on_face(geometry, f, side, uv[p, 0], uv[p, 1], origin)
        for k in range(3):
            inverted_step = 1 if is_inverted and k == 0 else 0
            a, b = i + (1 if k == 1 else inverted_step), j + (1 if k == 2 else inverted_step)
            _point_on_face(geometry, f, side, a / num_rows, b / num_rows, target)
            _aim_between(packet, 3 * num_pending + k, origin, target)
        packet.owner[num_pending] = p
        num_pending += 1
        if num_pending == _RAYS_PER_PACKET:
            _reweight_traced(packet, num_pending, weight)
            num_pending = np.int64(0)
    if num_pending:
        _reweight_traced(packet, num_pending, weight)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _reweight_traced(packet, num_pending, weight):  # type: ignore[no-untyped-def]
    """Trace three lanes for each pending ray; weights of occluded nodes become zero."""
    enable_first_lanes(packet, 3 * num_pending)
    trace_shadows(packet)
    for r in range(num_pending):
        p, total = packet.owner[r], np.float32(0)
        for k in range(3):
            total += weight[p, k] if is_unoccluded(packet, 3 * r + k) else np.float32(0)
        for k in range(3):
            if total > 0:
                weight[p, k] = weight[p, k] / total if is_unoccluded(packet, 3 * r + k) else np.float32(0)


def reweight(gbuffer: GBuffer, has_occluded_neighbor: Shaped[NDArray[np.uint8], " nodes"], mesh: OcclusionMesh) -> None:
    """Exclude nodes that are occluded from the hits of rays.

    Args:
        gbuffer: its weights are overwritten. has_occluded_neighbor: from `find_occluded_probes`.
        mesh: the scene.
    """
    if not has_occluded_neighbor.any():
        return
    args = mesh.embree.shadow_tracer(coherent=False), _grid_geometry(mesh), has_occluded_neighbor, gbuffer
    parallel_for_chunks(lambda start, stop: _reweight(*args, start, stop), len(gbuffer.directions))
