"""Which nodes of a lattice are one, which of them are points, and how the others follow from points nearby.

Corners of a mesh that is finer than points are dense keep their own normals (`relume.moving.points.following`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.points.following import APART, from_ends, from_nearby
from relume.moving.points.grids import Lattice
from relume.parallel import for_shares
from relume.points import Points
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TOGETHER = 0.35  # of the spacing: nodes as near as this are one point
_SAME = 1e-3  # of it: nodes as near as this are one vertex
_SAME_WAY = 50  # steps of a unit normal's components, within which vertices look the same way
_TURN = 1.5  # spacings that a turn of the normal by a radian is worth
_PLACE_BITS = 20  # of each coordinate: places finer than a millionth of the scene are one
_U64 = np.uint64
_MIX = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F], np.uint64)  # odd
_ELSEWHERE = 4.0  # that a surface which does not hang together with another is farther away than it is


class Vertices(NamedTuple):
    """Corners of all grids, each once.

    Attributes:
        normal: unit, on the side that is seen. (V, 3) float32
        point: those about it, unlike each other or of no weight. (V, `POINTS_A_VERTEX`) uint32
        weight: of each, one in sum. (V, `POINTS_A_VERTEX`) float32
    """

    normal: F32
    point: NDArray[np.uint32]
    weight: F32


class Nodes(NamedTuple):
    """Nodes of all grids, before any are shared.

    Attributes:
        points: where they are. material, side: of each. (n,)
        spacing: of the points about each, metres; powers of two of one another. (n,)
        is_point: whether it may be a point; others lie in the middle of nodes of coarser grids. (n,)
        corner, extent: of what holds all of them, from `extent_of`.
    """

    points: Points
    material: NDArray[np.uint16]
    side: NDArray[np.uint8]
    piece: NDArray[np.int32]
    spacing: F64
    is_point: NDArray[np.bool_]
    corner: F32
    extent: float

    def rows(self, chosen: NDArray[np.intp]) -> Nodes:
        """Choose some of them."""
        return self._replace(
            points=self.points.rows(chosen),
            material=self.material[chosen],
            side=self.side[chosen],
            piece=self.piece[chosen],
            spacing=self.spacing[chosen],
            is_point=self.is_point[chosen],
        )


def shared_points(nodes: Nodes, alike: int) -> NDArray[np.intp]:
    """Find nodes that stand for all, material after material, neighbours mostly next to each other.

    Args:
        alike: steps of a unit normal's components, within which points look the same way.
    """
    may_be = np.flatnonzero(nodes.is_point)
    chosen, _ = _shared(nodes.rows(may_be), _TOGETHER, alike)
    return may_be[chosen]


def num_shared(nodes: Nodes, alike: int) -> int:
    """How many `shared_points` finds, for whoever tries several spacings.

    Args:
        nodes: of all grids; their keys are mixed to one number each, which few that differ share by chance.
        alike: as of `shared_points`.
    """
    where, what = _keys(nodes.rows(np.flatnonzero(nodes.is_point)), _TOGETHER, alike)
    mixed = (where ^ where >> _U64(31)) * _MIX[0] ^ (what ^ what >> _U64(29)) * _MIX[1]
    mixed.sort()
    return 1 + int(np.count_nonzero(mixed[1:] != mixed[:-1]))


def find_vertices(nodes: Nodes, chosen: NDArray[np.intp], lattice: Lattice) -> tuple[Vertices, NDArray[np.uint32]]:
    """Find the vertices that nodes are, and how they follow from points.

    Args:
        nodes: of all grids. chosen: those that are points. lattice: of the nodes.
    Returns:
        The vertices, and which of them each node is. (n,) uint32
    """
    first, vertex = _shared(nodes, _SAME, _SAME_WAY)
    place, alone = _features(nodes), np.flatnonzero(nodes.is_point[first])
    near = from_nearby(place[chosen], place[first[alone]], nodes.points.normal[first[alone]])
    follows = near if len(alone) == len(first) else from_ends(near, alone, vertex, lattice)
    return Vertices(np.ascontiguousarray(nodes.points.normal[first]), *follows), vertex.astype(np.uint32)


def _features(nodes: Nodes) -> F64:
    """Where nodes are, in spacings, for what is near to be like. (n, 11)"""
    place = nodes.points.position.astype(np.float64) / nodes.spacing.min()
    apart = APART * np.column_stack([nodes.material, nodes.side])
    elsewhere = np.random.default_rng(1).normal(size=(int(nodes.piece.max()) + 1, 3))
    elsewhere *= _ELSEWHERE / np.sqrt(2) / np.linalg.norm(elsewhere, axis=1, keepdims=True)
    return np.column_stack([place, _TURN * nodes.points.normal, apart, elsewhere[nodes.piece]])


def extent_of(points: Points) -> tuple[F32, float]:
    """Find the least corner of what holds all points, (3,), and its longest side, metres. points: at least one"""
    position = points.position
    return position.min(axis=0), max(float(np.ptp(position, axis=0).max()), 1e-30)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _key(points, material, side, level, size, corner, alike, start, stop, where, what):  # type: ignore[no-untyped-def]
    """Find the keys of nodes [start, stop). size: of the boxes in which they lie together. (n,) float64"""
    position, normal = points
    base = 2 * alike + 1
    for i in range(start, stop):
        place, way = np.uint64(0), np.int64(0)
        for axis in range(3):
            box = np.uint64(math.floor(np.float64(position[i, axis] - corner[axis]) / size[i]))
            place = (place << np.uint64(_PLACE_BITS)) | box
            way = way * base + np.int64(np.rint(normal[i, axis] * np.float32(alike))) + alike
        where[i] = place
        what[i] = (np.uint64(2 * way + side[i]) << np.uint64(24)) | (level[i] << np.uint64(16)) | np.uint64(material[i])


def _keys(nodes: Nodes, together: float, alike: int) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Two numbers that nodes have alike which lie together. (n,) uint64 each"""
    points, corner, extent = nodes.points, nodes.corner, nodes.extent
    level = np.rint(np.log2(nodes.spacing / nodes.spacing.min())).astype(np.uint64)
    size = np.maximum(together * nodes.spacing, extent / ((1 << _PLACE_BITS) - 1))
    where, what = np.empty(len(size), np.uint64), np.empty(len(size), np.uint64)
    args = (points.position, points.normal), nodes.material, nodes.side, level, size, corner, alike
    for_shares(lambda start, stop: _key(*args, start, stop, where, what), len(size))
    return where, what


def keys_numpy(nodes: Nodes, together: float, alike: int) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Find the keys in plain NumPy: the oracle.

    Args:
        nodes: of all grids. together: of the spacing, within which they are one.
        alike: steps of a unit normal's components, within which they look the same way.
    Returns:
        Two numbers that nodes have alike which lie together. (n,) uint64 each
    """
    points, corner, extent = nodes.points, nodes.corner, nodes.extent
    level = np.rint(np.log2(nodes.spacing / nodes.spacing.min())).astype(np.uint64)
    size = np.maximum(together * nodes.spacing, extent / ((1 << _PLACE_BITS) - 1))
    place = np.floor((points.position - corner) / size[:, None]).astype(np.uint64)
    way = np.rint(points.normal * np.float32(alike)).astype(np.int64) + alike
    base = 2 * alike + 1
    kind = (((way[:, 0] * base + way[:, 1]) * base + way[:, 2]) * 2 + nodes.side).astype(np.uint64)
    where = (place[:, 0] << _U64(2 * _PLACE_BITS)) | (place[:, 1] << _U64(_PLACE_BITS)) | place[:, 2]
    return where, (kind << _U64(24)) | (level << _U64(16)) | nodes.material.astype(np.uint64)


def _shared(nodes: Nodes, together: float, alike: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find one of the nodes that lie together, in the order of their places, and for each node which it is."""
    points, corner, extent = nodes.points, nodes.corner, nodes.extent
    where, what = _keys(nodes, together, alike)
    order = np.lexsort((~nodes.is_point, what, where))  # stable: of equals a point, the one with the lowest number
    is_new = np.concatenate([[True], (where[order[1:]] != where[order[:-1]]) | (what[order[1:]] != what[order[:-1]])])
    first, group = order[is_new], np.cumsum(is_new) - 1
    finely = np.floor((points.position[first] - corner) / (extent / ((1 << _PLACE_BITS) - 1))).astype(np.uint64)
    in_order = np.lexsort((_interleaved(finely), nodes.material[first]))
    rank = np.empty(len(first), np.intp)
    rank[in_order] = np.arange(len(first))
    found = np.empty(len(order), np.intp)
    found[order] = rank[group]
    return first[in_order], found


def _interleaved(place: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Order places along a Morton curve: neighbours come mostly next to each other. (n,) uint64"""
    code = np.zeros(len(place), np.uint64)
    for bit in range(_PLACE_BITS):
        for axis in range(3):
            code |= (place[:, axis] >> _U64(bit) & _U64(1)) << _U64(3 * bit + axis)
    return code
