"""How vertices of a lattice follow from points.

A mesh may be much finer than points are dense: its corners take what a few points about them send, by Shepard's weights
((R − d) / (R d))², where R is the distance of the first point that is left out, changed by as little as it takes for
light that is linear in the tangent plane to be met. A corner that is a point itself takes its own. Nodes inside a face
whose points are farther apart than its nodes lie on the straight line between those.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from relume.moving.points.grids import Lattice, in_the_middle, steps_of

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

POINTS_A_VERTEX = 4
APART = 1e3  # spacings between materials, and between sides
_BENDS = 0.05  # how far off what is linear may stay, beside how far weights change
_LEAST_WEIGHT = 2e-3
_AT_ONCE = 1 << 16  # vertices


class Follows(NamedTuple):
    """Points and weights of vertices.

    Attributes:
        point: unlike each other or of no weight. (V, `POINTS_A_VERTEX`) uint32
        weight: of each, one in sum. (V, `POINTS_A_VERTEX`) float32
    """

    point: NDArray[np.uint32]
    weight: F32


def from_nearby(points: F64, places: F64, normals: F32) -> Follows:
    """Weigh the points about some places.

    Args:
        points, places: in spacings; coordinates, then what makes them unlike. (n, d), (V, d)
        normals: at the places, unit. (V, 3)
    """
    tree = cKDTree(points)
    few = min(len(points), POINTS_A_VERTEX + 1)
    distance, near = tree.query(places, few, workers=-1)
    distance, near = distance.reshape(len(places), few), near.reshape(len(places), few)
    reach = np.maximum(distance[:, -1:], 1e-12)
    inside = np.clip(distance[:, :-1], 1e-6 * reach, None) if few > 1 else np.ones((len(places), 1))
    raw = np.square((reach - inside) / (reach * inside)) if few > 1 else inside
    raw[distance[:, : raw.shape[1]] > APART / 2] = 0  # another material's, where there are so few
    raw[:, 0] = np.maximum(raw[:, 0], 1e-12)
    found = _nothing(len(places))
    found.weight[:, : raw.shape[1]] = raw / raw.sum(axis=1, keepdims=True)
    found.point[:, : raw.shape[1]] = near[:, : raw.shape[1]]
    for start in range(0, len(places), _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        towards = (points[found.point[rows], :3] - places[rows, None, :3]).transpose(0, 2, 1)
        found.weight[rows] = linear(found.weight[rows].astype(np.float64), towards, normals[rows].astype(np.float64))
    return found


def linear(weight: F64, towards: F64, normal: F64) -> F64:
    """Change weights as little as it takes for the points' mean to lie under their vertex, Σ w x = 0, nearly.

    With W the weights on a diagonal, F the x, in units of their spread, above a row of ones, and b = (0, 0, 0, 1):
    w − W Fᵀ (F W Fᵀ + λ)⁻¹ (F w − b).

    Args:
        weight: of points, one in sum. (V, p) towards: where they are. (V, 3, p) normal: unit. (V, 3)
    Returns:
        None below nothing: where points lie on one side alone, what is linear is met less. (V, p)
    """
    x = towards - normal[:, :, None] * np.einsum("vc,vcp->vp", normal, towards)[:, None]
    x *= weight[:, None] > 0
    x /= np.maximum(np.sqrt(np.einsum("vcp,vp->v", x**2, weight)), 1e-9)[:, None, None]
    ends = np.concatenate([x, np.ones_like(x[:, :1])], axis=1)
    weighed = ends * weight[:, None]
    gram = np.einsum("vcp,vdp->vcd", weighed, ends) + np.diag([_BENDS] * 3 + [1e-9])
    missed = np.einsum("vcp,vp->vc", ends, weight) - [0, 0, 0, 1]
    found = weight - np.einsum("vcp,vc->vp", weighed, np.linalg.solve(gram, missed[..., None])[..., 0])
    return _in_sum_one(found)


def from_ends(near: Follows, alone: NDArray[np.intp], vertex: NDArray[np.intp], lattice: Lattice) -> Follows:
    """Let the other vertices be the mean of both ends of the edges that they are in the middle of, coarse ones first.

    Args:
        near: of the vertices `alone`. vertex: that each node of the lattice is. (nodes,)
    """
    num, num_points = int(vertex.max()) + 1, int(near.point.max()) + 1
    place = np.repeat(alone, POINTS_A_VERTEX), near.point.ravel().astype(np.intp)
    known = csr_array((near.weight.ravel(), place), shape=(num, num_points))
    known.eliminate_zeros()
    is_known = np.zeros(num, np.bool_)
    is_known[alone] = True
    steps, step = steps_of(lattice.num_rows), 1 << int(np.log2(lattice.num_rows.max()))
    while step >= 1:
        node, *ends = in_the_middle(steps, lattice.first, np.flatnonzero(~is_known[vertex]), step)
        which, once = np.unique(vertex[node], return_index=True)
        both = np.concatenate([vertex[end[once]] for end in ends])
        means = csr_array((np.full(len(both), np.float32(0.5)), (np.tile(which, 2), both)), shape=(num, num))
        known = known + means @ known
        is_known[which] = True
        step //= 2
    return _heaviest(known)


def _heaviest(known: csr_array) -> Follows:
    """Keep the points of the greatest weight in each row, as many as a vertex has."""
    count = np.diff(known.indptr)
    row = np.repeat(np.arange(len(count)), count)
    order = np.lexsort((-known.data, row))
    rank = np.arange(len(order)) - np.repeat(known.indptr[:-1], count)
    kept = rank < POINTS_A_VERTEX
    found = _nothing(len(count))
    found.point[row[kept], rank[kept]] = known.indices[order[kept]]
    found.weight[row[kept], rank[kept]] = known.data[order[kept]]
    return Follows(found.point, _in_sum_one(found.weight))


def _in_sum_one(weight: NDArray[Any]) -> NDArray[Any]:
    """Leave out what is below nothing, and what cannot be seen: each point that is asked sums all its lights."""
    kept = np.where(weight < _LEAST_WEIGHT, 0, weight)
    return np.asarray(kept / kept.sum(axis=1, keepdims=True), weight.dtype)


def _nothing(num: int) -> Follows:
    shape = num, POINTS_A_VERTEX
    return Follows(np.zeros(shape, np.uint32), np.zeros(shape, np.float32))
