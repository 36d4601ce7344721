"""Which lights are next to each other on the sphere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

_MAX_COMPLETE_LIGHTS = 8  # up to here all are neighbours of all


class LightNeighbors(NamedTuple):
    """The neighbours of light m are `beside[first[m]:first[m + 1]]`, ascending, never m itself.

    Attributes:
        first: (num_lights + 1,) int32. neighbors: (sum of all their numbers,) int32
    """

    first: NDArray[np.int32]
    neighbors: NDArray[np.int32]


def find_neighbors(directions: NDArray[np.float32]) -> LightNeighbors:
    """Find neighbours in the Delaunay triangulation of the sphere, which is the convex hull of the directions.

    A direction that coincides with another is the neighbour of that one alone.

    Args:
        directions: unit, not all in one plane where there are more than eight. (num_lights, 3)
    Cost: O(n log n) time.
    """
    num_lights = len(directions)
    if num_lights <= _MAX_COMPLETE_LIGHTS:
        pairs = np.argwhere(~np.eye(num_lights, dtype=np.bool_))
    else:
        vectors = directions.astype(np.float64)
        corners = ConvexHull(vectors).simplices
        lost = np.setdiff1d(np.arange(num_lights), corners)
        nearest = cKDTree(vectors).query(vectors[lost], k=2)[1].reshape(-1, 2)
        twin = np.where(nearest[:, 0] == lost, nearest[:, 1], nearest[:, 0])
        edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]], np.stack([lost, twin], 1)])
        pairs = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    first = np.searchsorted(pairs[:, 0], np.arange(num_lights + 1))
    return LightNeighbors(first.astype(np.int32), pairs[:, 1].astype(np.int32))
