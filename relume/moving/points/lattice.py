"""Points on all surfaces of a scene: a grid inside each face, shared between faces (mesh colours, Yuksel 2010).

A face whose longest edge is R spacings long has (R + 1)(R + 2) / 2 nodes, rows parallel to its first edge. Nodes of
different faces that lie together, look the same way and are of one material are one point, so that light is continuous
across edges, and a mesh finer than the spacing has fewer points than corners, which then follow from the points about
them (`relume.moving.points.vertices`). Each side of a face that can be seen has nodes of its own
(`relume.moving.points.sides`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from relume.errors import PlanError
from relume.moving.points.vertices import Nodes, Vertices, extent_of, find_vertices, num_shared, shared_points
from relume.points import Points
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits
from relume.trace.surface import surface_at

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_POINTS = 2_000_000
MOST_ROWS = 255  # of the grid in one face
_ALIKE, _LEAST_ALIKE = 3, 1  # steps of a unit normal's components, within which points look the same way
_TRIALS, _MOST_TRIALS = 6, 40  # after the first, fewer points than asked for are good enough, and each is coarser
_COARSER = 1.25
_WIDEST = 16.0  # spacing, beside the longest edge: then all that may be shared is
_NODES_A_POINT = 8  # more where faces are thin
_CLOSE_ENOUGH = 0.05  # of the number of points asked for


class Lattice(NamedTuple):
    """The grid of every side of every face; side 0 is the one where the corners are counter-clockwise.

    Attributes:
        num_rows: R; 0 where the side has no points. (faces, 2) uint8
        first: where its nodes begin in `node`. (faces, 2) uint32
        node: which vertex each is. (nodes,) uint32
    """

    num_rows: NDArray[np.uint8]
    first: NDArray[np.uint32]
    node: NDArray[np.uint32]


@dataclass(frozen=True)
class Placed:
    """Points on surfaces, and the lattice that takes from them what they send.

    Attributes:
        vertices: of the lattice.
        points: n of them, neighbours mostly next to each other, material after material.
        material: of each. (n,) uint16
        spacing: about the distance of neighbours at a middling distance from the eye, metres.
    """

    lattice: Lattice
    vertices: Vertices
    points: Points
    material: NDArray[np.uint16]
    spacing: float


class _Placement(NamedTuple):
    """Where nodes are in faces: face, side, and barycentric coordinates of the second and third corner."""

    face: NDArray[np.int32]
    side: NDArray[np.uint8]
    uv: F32


def num_nodes(rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """How many nodes grids with so many rows have; none where there are no rows."""
    wide = rows.astype(np.int64)
    return np.where(wide > 0, (wide + 1) * (wide + 2) // 2, 0)


@nb.njit(nogil=True, cache=True, inline="always")
def node_of(rows, i, j):  # type: ignore[no-untyped-def]
    """Number of a node in a grid of so many rows: i steps towards the second corner, j towards the third."""
    return i * (rows + 1) - (i * (i - 1)) // 2 + j


def place_points(geometry: Geometry, is_open: NDArray[np.bool_], coarse: F64, num_points: int) -> Placed:
    """Spread about `num_points` points over all sides that can be seen.

    Args:
        geometry: the scene's triangles. is_open: which sides of faces can be seen. (faces, 2)
        coarse: how many times farther apart than elsewhere points of each face are, powers of two, see
            `relume.moving.points.density`. (faces,)
        num_points: at most `MAX_POINTS`.
    Raises:
        PlanError: no surface has any area.
    """
    corners = geometry.positions[geometry.faces].astype(np.float64)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    area = geometry.face_areas
    is_open = is_open & (area > 0)[:, None]
    total = float((is_open * area[:, None]).sum())
    if total <= 0:
        raise PlanError("no surface of the scene has any area; there is nothing to put points on")
    longest, count = edges.max(axis=1) / coarse, is_open.sum(axis=1)
    spacing, most = math.sqrt(total / num_points), most_nodes(len(geometry.faces), num_points)

    def is_too_fine(spacing: float) -> bool:
        return int((num_nodes(_rows(longest, spacing)) * count).sum()) > most

    while is_too_fine(spacing) and spacing < longest.max():
        spacing *= _COARSER
    normals, piece = geometry.face_normals, pieces_of(geometry)
    rows, alike = _rows(longest, spacing), _ALIKE
    lattice, nodes = _grids(geometry, normals, piece, is_open, rows, spacing * coarse)
    for trial in range(_MOST_TRIALS):
        alike = max(_LEAST_ALIKE, _ALIKE - max(0, trial - _TRIALS))  # where directions alone are too many
        ratio = num_shared(nodes, alike) / num_points
        if abs(ratio - 1) < _CLOSE_ENOUGH or (ratio < 1 and trial >= _TRIALS):
            break
        finer = spacing * math.sqrt(ratio) * (1 if trial < _TRIALS else _COARSER)
        if ratio < 1 and is_too_fine(finer):
            break
        before, spacing = spacing, min(finer, _WIDEST * float(longest.max()))
        if np.array_equal(rows, wanted := _rows(longest, spacing)):  # finer than points are dense: corners alone
            nodes = nodes._replace(spacing=nodes.spacing * (spacing / before))
        else:
            rows, (lattice, nodes) = wanted, _grids(geometry, normals, piece, is_open, wanted, spacing * coarse)
    chosen = shared_points(nodes, alike)
    vertices, vertex = find_vertices(nodes, chosen)
    kept = nodes.points.rows(chosen)._replace(seed=np.arange(len(chosen), dtype=np.uint32))
    return Placed(lattice._replace(node=vertex), vertices, kept, nodes.material[chosen], spacing)


def pieces_of(geometry: Geometry) -> NDArray[np.int32]:
    """Find which faces hang together by corners in the same place. (faces,) int32"""
    as_bytes = np.ascontiguousarray(geometry.positions, np.float32).view("V12").ravel()
    _, place = np.unique(as_bytes, return_inverse=True)
    a, b, c = place[geometry.faces].T
    pairs = np.concatenate([a, b]), np.concatenate([b, c])
    num = int(place.max()) + 1
    _, piece = connected_components(coo_array((np.ones(len(pairs[0]), np.bool_), pairs), (num, num)), directed=False)
    return np.asarray(piece[a], np.int32)


def most_nodes(num_faces: int, num_points: int) -> int:
    """How many nodes a scene's lattice has at most: the corners of all sides, and what is between."""
    return 6 * num_faces + _NODES_A_POINT * num_points


def _rows(longest: F64, spacing: float) -> NDArray[np.int64]:
    return np.clip(np.ceil(longest / spacing), 1, MOST_ROWS).astype(np.int64)


def _grids(
    geometry: Geometry,
    normals: F32,
    piece: NDArray[np.int32],
    is_open: NDArray[np.bool_],
    rows: NDArray[np.int64],
    spacing: F64,
) -> tuple[Lattice, Nodes]:
    """Place the nodes of all grids, which are not numbered as vertices yet.

    normals: of the faces. (faces, 3). piece: that each is of. spacing: of points on each. (faces,)
    """
    num_rows = np.where(is_open, rows[:, None], 0).astype(np.uint8)
    counts = num_nodes(num_rows).ravel()
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).reshape(num_rows.shape)
    at = _placement(num_rows, counts)
    normal = normals[at.face] * np.where(at.side == 0, 1, -1)[:, None].astype(np.float32)
    points = surface_at(geometry, Hits(at.face, at.uv, np.ones(len(at.face), np.float32)), -normal).points
    material = geometry.face_material[at.face].astype(np.uint16)
    lattice = Lattice(num_rows, first.astype(np.uint32), np.empty(0, np.uint32))
    return lattice, Nodes(points, material, at.side, piece[at.face], spacing[at.face], *extent_of(points))


def _placement(num_rows: NDArray[np.uint8], counts: NDArray[np.int64]) -> _Placement:
    """List the nodes of all grids, in the order of `node_of`."""
    side_of = np.repeat(np.arange(len(counts)), counts)
    uv = np.empty((int(counts.sum()), 2), np.float32)
    ends = np.cumsum(counts)
    flat = num_rows.ravel()
    for rows in map(int, np.unique(flat[flat > 0])):
        i, j = np.array([(i, j) for i in range(rows + 1) for j in range(rows + 1 - i)]).T
        begin = (ends - counts)[flat == rows]
        where = begin[:, None] + np.arange(len(i))
        uv[where, 0], uv[where, 1] = (i / rows).astype(np.float32), (j / rows).astype(np.float32)
    return _Placement((side_of // 2).astype(np.int32), (side_of % 2).astype(np.uint8), uv)
