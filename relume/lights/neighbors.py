"""Neighboring lights on the sphere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

_MAX_COMPLETE_LIGHTS = 8  # up to this number all lights are neighbors of each other


class LightNeighbors(NamedTuple):
    """Neighbors of lights: those of light m are `neighbors[first[m]:first[m + 1]]`, ascending, without m itself."""

    first: Shaped[NDArray[np.int32], " ends"]
    neighbors: Shaped[NDArray[np.int32], " pairs"]


def find_neighbors(directions: Shaped[NDArray[np.float32], "lights 3"]) -> LightNeighbors:
    """Find neighbors by Delaunay triangulation of the sphere, the convex hull of the directions. O(n log n) time.

    A direction that coincides with another has that one as its only neighbor.

    Args:
        directions: unit, not all in one plane if there are more than eight.
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
