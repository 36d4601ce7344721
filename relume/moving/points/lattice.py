"""Points on all surfaces of a scene: a grid inside each face, shared between faces (mesh colours, Yuksel 2010).

A face whose longest edge is R of the least spacings on it long has R rows (`relume.moving.points.grids`); where points
shall be 2^l times as far apart, every 2^l-th node of both ways is one. Nodes of different faces that lie together, look
the same way and are of one material are one point, so that light is continuous across edges, and a mesh finer than the
spacing has fewer points than corners. What is no point follows from those about it (`relume.moving.points.following`).
Each side of a face that can be seen has nodes of its own (`relume.moving.points.sides`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from relume.errors import PlanError
from relume.moving.points.grids import Density, Lattice, first_nodes, num_nodes, steps_of
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
NODES_A_POINT = 8  # more where faces are thin
_ENDS: tuple[tuple[Literal["left", "right"], int], ...] = (("left", 0), ("right", 1))  # of equals in order
_NARROW = 8.0  # times as long as wide
_CLOSE_ENOUGH = 0.05  # of the number of points asked for


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


def place_points(geometry: Geometry, is_open: NDArray[np.bool_], density: Density, num_points: int) -> Placed:
    """Spread about `num_points` points over all sides that can be seen.

    Args:
        geometry: the scene's triangles. is_open: which sides of faces can be seen. (faces, 2)
        density: how far apart points are, see `relume.moving.points.density`; of `one_row` at first.
        num_points: at most `MAX_POINTS`.
    Raises:
        PlanError: no surface has any area.
    """
    corners = geometry.positions[geometry.faces].astype(np.float64)
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    area = geometry.face_areas
    is_open = is_open & (area > 0)[:, None]
    total = float((is_open * area[:, None]).sum())
    if total <= 0:
        raise PlanError("no surface of the scene has any area; there is nothing to put points on")
    least, most_apart = density.of_faces()
    across = other_halves(geometry, edges)
    least, most_apart = np.minimum(least, least[across]), np.maximum(most_apart, most_apart[across])
    longest, count = edges.max(axis=1) / 2.0**least, is_open.sum(axis=1)
    spacing, most = math.sqrt(total / num_points), most_nodes(len(geometry.faces), num_points)

    def rows_at(spacing: float) -> NDArray[np.int64]:
        return _rows(longest, spacing, (most_apart - least).astype(np.int64))

    def is_too_fine(spacing: float) -> bool:
        return int((num_nodes(rows_at(spacing)) * count).sum()) > most

    while is_too_fine(spacing) and spacing < longest.max():
        spacing *= _COARSER
    surfaces = _Surfaces(geometry, geometry.face_normals, pieces_of(geometry), is_open, density, least)
    rows, alike = rows_at(spacing), _ALIKE
    lattice, nodes = _grids(surfaces, rows, spacing)
    power, last, before = -2.0, 0, spacing  # of the spacing, that points are as many as; how many there were
    for trial in range(_MOST_TRIALS):
        alike = max(_LEAST_ALIKE, _ALIKE - max(0, trial - _TRIALS))  # where directions alone are too many
        found = num_shared(nodes, alike)
        ratio = found / num_points
        if abs(ratio - 1) < _CLOSE_ENOUGH or (ratio < 1 and trial >= _TRIALS):
            break
        if last and found != last and spacing != before:
            power = min(max(math.log(found / last) / math.log(spacing / before), -2.0), -0.25)
        finer = spacing * ratio ** (-1 / power) * (1 if trial < _TRIALS else _COARSER)
        if ratio < 1 and is_too_fine(finer) and is_too_fine(finer := math.sqrt(spacing * finer)):
            break
        last, before, spacing = found, spacing, min(finer, _WIDEST * float(longest.max()))
        if np.array_equal(rows, wanted := rows_at(spacing)):  # finer than points are dense: corners alone
            nodes = nodes._replace(spacing=nodes.spacing * (spacing / before))
        else:
            rows, (lattice, nodes) = wanted, _grids(surfaces, wanted, spacing)
    chosen = shared_points(nodes, alike)
    vertices, vertex = find_vertices(nodes, chosen, lattice)
    kept = nodes.points.rows(chosen)._replace(seed=np.arange(len(chosen), dtype=np.uint32))
    return Placed(lattice._replace(node=vertex), vertices, kept, nodes.material[chosen], spacing)


def other_halves(geometry: Geometry, edges: F64) -> NDArray[np.intp]:
    """Find the other half of the strip that each narrow face is of; else, and of all others, the face itself.

    Both halves of a long narrow strip lie in the same place and shall have grids alike: where one knew a shadow that
    the other had no nodes for, strips beside each other looked like a net.

    Args:
        edges: how long each is that begins at a face's corners. (faces, 3)
    Returns:
        (faces,)
    """
    place = geometry.places[geometry.faces].astype(np.int64)
    ends = np.sort(np.stack([place, np.roll(place, -1, axis=1)]), axis=0)
    edge = ends[0] * (int(place.max()) + 1) + ends[1]
    longest, every = edges.argmax(axis=1), edge.ravel()
    wanted = np.take_along_axis(edge, longest[:, None], axis=1)[:, 0]
    order = np.argsort(every, kind="stable")
    first, last = (order[np.searchsorted(every, wanted, side, order) - less] // 3 for side, less in _ENDS)
    itself = np.arange(len(place))
    is_narrow = edges.max(axis=1) ** 2 > _NARROW * 2 * geometry.face_areas
    return np.asarray(np.where(is_narrow, np.where(first == itself, last, first), itself))


def pieces_of(geometry: Geometry) -> NDArray[np.int32]:
    """Find which faces hang together by corners in the same place. (faces,) int32"""
    place = geometry.places
    a, b, c = place[geometry.faces].T
    pairs = np.concatenate([a, b]), np.concatenate([b, c])
    num = int(place.max()) + 1
    _, piece = connected_components(coo_array((np.ones(len(pairs[0]), np.bool_), pairs), (num, num)), directed=False)
    return np.asarray(piece[a], np.int32)


def most_nodes(num_faces: int, num_points: int) -> int:
    """How many nodes a scene's lattice has at most: the corners of all sides, and what is between."""
    return 6 * num_faces + NODES_A_POINT * num_points


def _rows(longest: F64, spacing: float, levels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Find how many rows grids have: of those whose points are 2^levels times as far apart somewhere, a multiple."""
    rows = np.clip(np.ceil(longest / spacing), 1, MOST_ROWS).astype(np.int64)
    step = 1 << np.minimum(levels, np.log2(rows).astype(np.int64))
    return np.asarray(np.minimum(-(-rows // step), MOST_ROWS // step) * step)


class _Surfaces(NamedTuple):
    """Whose points are placed. normals, piece, least: of faces, see `Density.of_faces`."""

    geometry: Geometry
    normals: F32
    piece: NDArray[np.int32]
    is_open: NDArray[np.bool_]
    density: Density
    least: NDArray[np.int8]


def _grids(surfaces: _Surfaces, rows: NDArray[np.int64], spacing: float) -> tuple[Lattice, Nodes]:
    """Place the nodes of all grids, which are not numbered as vertices yet."""
    geometry, normals, piece, is_open, density, least_of = surfaces
    num_rows = np.where(is_open, rows[:, None], 0).astype(np.uint8)
    steps = steps_of(num_rows)
    face, side = (steps.grid // 2).astype(np.int32), (steps.grid % 2).astype(np.uint8)
    uv = np.column_stack([steps.i / steps.rows, steps.j / steps.rows]).astype(np.float32)
    normal = normals[face] * np.where(side == 0, 1, -1)[:, None].astype(np.float32)
    points = surface_at(geometry, Hits(face, uv, np.ones(len(face), np.float32)), -normal).points
    power, least = density.at(steps), least_of[face]
    step = 1 << (power - least).astype(np.int64)
    step = np.minimum(step, steps.rows & -steps.rows)  # the most that divides the rows
    is_point = (steps.i % step == 0) & (steps.j % step == 0)
    apart = spacing * 2.0 ** (least + np.log2(step))
    lattice = Lattice(num_rows, first_nodes(num_rows), np.empty(0, np.uint32))
    of_faces = geometry.face_material[face].astype(np.uint16), side, piece[face]
    return lattice, Nodes(points, *of_faces, apart, is_point, *extent_of(points))


def one_row(is_open: NDArray[np.bool_]) -> Lattice:
    """Make a lattice of the corners alone. is_open: sides of faces that have them. (faces, 2)"""
    rows = is_open.astype(np.uint8)
    return Lattice(rows, first_nodes(rows), np.empty(0, np.uint32))
