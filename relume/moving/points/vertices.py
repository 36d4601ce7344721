"""Which nodes of a lattice are one, which of them are points, and how the others follow from points nearby.

A mesh may be much finer than points are dense: its corners keep their own normals, and take what a few points about
them send, by Shepard's weights ((R − d) / (R d))², where R is the distance of the first point that is left out. A
corner that is a point itself takes its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from relume.points import Points

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

POINTS_A_VERTEX = 4
_TOGETHER = 0.35  # of the spacing: nodes as near as this are one point
_SAME = 1e-3  # of it: nodes as near as this are one vertex
_SAME_WAY = 50  # steps of a unit normal's components, within which vertices look the same way
_TURN = 1.5  # spacings that a turn of the normal by a radian is worth
_PLACE_BITS = 20  # of each coordinate: places finer than a millionth of the scene are one
_U64 = np.uint64
_APART = 1e3  # spacings between materials, and between sides
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
    """

    points: Points
    material: NDArray[np.uint16]
    side: NDArray[np.uint8]
    piece: NDArray[np.int32]
    spacing: F64


def shared_points(nodes: Nodes, alike: int) -> NDArray[np.intp]:
    """Find nodes that stand for all, material after material, neighbours mostly next to each other.

    Args:
        alike: steps of a unit normal's components, within which points look the same way.
    """
    chosen, _ = _shared(nodes, _TOGETHER, alike)
    return chosen


def find_vertices(nodes: Nodes, chosen: NDArray[np.intp]) -> tuple[Vertices, NDArray[np.uint32]]:
    """Find the vertices that nodes are, and how they follow from points.

    Args:
        nodes: of all grids. chosen: those that are points.
    Returns:
        The vertices, and which of them each node is. (n,) uint32
    """
    first, vertex = _shared(nodes, _SAME, _SAME_WAY)
    place = _features(nodes)
    tree = cKDTree(place[chosen])
    few = min(len(chosen), POINTS_A_VERTEX + 1)
    distance, near = tree.query(place[first], few, workers=-1)
    distance, near = distance.reshape(len(first), few), near.reshape(len(first), few)
    reach = np.maximum(distance[:, -1:], 1e-12)
    inside = np.clip(distance[:, :-1], 1e-6 * reach, None) if few > 1 else np.ones((len(first), 1))
    raw = np.square((reach - inside) / (reach * inside)) if few > 1 else inside
    raw[distance[:, : raw.shape[1]] > _APART / 2] = 0  # another material's, where there are so few
    raw[:, 0] = np.maximum(raw[:, 0], 1e-12)
    weight, point = (
        np.zeros((len(first), POINTS_A_VERTEX), np.float32),
        np.zeros((len(first), POINTS_A_VERTEX), np.uint32),
    )
    weight[:, : raw.shape[1]] = raw / raw.sum(axis=1, keepdims=True)
    point[:, : raw.shape[1]] = near[:, : raw.shape[1]]
    return Vertices(np.ascontiguousarray(nodes.points.normal[first]), point, weight), vertex.astype(np.uint32)


def _features(nodes: Nodes) -> F64:
    """Where nodes are, in spacings, for what is near to be like. (n, 11)"""
    place = nodes.points.position.astype(np.float64) / nodes.spacing.min()
    apart = _APART * np.column_stack([nodes.material, nodes.side])
    elsewhere = np.random.default_rng(1).normal(size=(int(nodes.piece.max()) + 1, 3))
    elsewhere *= _ELSEWHERE / np.sqrt(2) / np.linalg.norm(elsewhere, axis=1, keepdims=True)
    return np.column_stack([place, _TURN * nodes.points.normal, apart, elsewhere[nodes.piece]])


def _shared(nodes: Nodes, together: float, alike: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find one of the nodes that lie together, in the order of their places, and for each node which it is."""
    points = nodes.points
    corner, extent = points.position.min(axis=0), max(float(np.ptp(points.position, axis=0).max()), 1e-30)
    level = np.rint(np.log2(nodes.spacing / nodes.spacing.min())).astype(np.uint64)
    size = np.maximum(together * nodes.spacing, extent / ((1 << _PLACE_BITS) - 1))
    place = np.floor((points.position - corner) / size[:, None]).astype(np.uint64)
    way = np.rint(points.normal * alike).astype(np.int64) + alike
    base = 2 * alike + 1
    kind = (((way[:, 0] * base + way[:, 1]) * base + way[:, 2]) * 2 + nodes.side).astype(np.uint64)
    where = (place[:, 0] << _U64(2 * _PLACE_BITS)) | (place[:, 1] << _U64(_PLACE_BITS)) | place[:, 2]
    what = (kind << _U64(24)) | (level << _U64(16)) | nodes.material.astype(np.uint64)
    order = np.lexsort((what, where))  # stable: the first of equals is the one with the lowest number
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
