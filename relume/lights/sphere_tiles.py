"""Spherical triangles that tile the sphere: leaves of a hierarchy over an octahedron.

Each triangle is split into four at its edges' midpoints, see `relume.lights.tile_subdivision`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_DEPTH = 28  # of the hierarchy: capacity of a 64-bit code

_OCTAHEDRON = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)
# counterclockwise from outside, as are all descendants; in the order of the signs of x, y, z
_OCTANTS = np.array([(5, 3, 1), (1, 3, 4), (1, 2, 5), (4, 2, 1), (0, 3, 5), (4, 3, 0), (5, 2, 0), (0, 2, 4)])
# corners of the children at a, b, c and in the middle, among the nodes a, b, c, ab, bc, ca
_CHILDREN = np.array([(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)])


def unit(v: Shaped[F64, " ..."]) -> Shaped[F64, " ..."]:
    """Normalize vectors along the last axis."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True), dtype=np.float64)


def solid_angles(corners: Shaped[F64, "M 3 3"]) -> Shaped[F64, " M"]:
    """Return the solid angles of spherical triangles, sr (van Oosterom and Strackee 1983)."""
    a, b, c = corners.transpose(1, 0, 2)
    dots = 1 + np.sum(a * b + b * c + c * a, axis=1)
    return np.asarray(2 * np.arctan2(np.sum(a * np.cross(b, c), axis=1), dots))


@dataclass(frozen=True)
class Tiles:
    """M triangles that tile the sphere.

    Attributes:
        codes: path of each in the hierarchy: 8 + octant, then two bits for the child at each level.
    """

    codes: Shaped[NDArray[np.uint64], " M"]

    def is_whole(self) -> bool:
        """Return True if the tiles are leaves of a hierarchy and cover the sphere once."""
        codes = set(map(int, self.codes))
        bits = [code.bit_length() for code in codes]
        if len(codes) != len(self.codes) or any(n % 2 or not 4 <= n <= 4 + 2 * MAX_DEPTH for n in bits):
            return False
        inner = {code >> shift for code in codes for shift in range(2, code.bit_length() - 3, 2)}
        return inner.isdisjoint(codes) and sum(4 ** (MAX_DEPTH - (n - 4) // 2) for n in bits) == 8 * 4**MAX_DEPTH

    @cached_property
    def corners(self) -> Shaped[F64, "M 3 3"]:
        """Unit directions of the corners of each tile, counterclockwise from outside."""
        return _corners(self.codes)

    @cached_property
    def traversal_key(self) -> Shaped[NDArray[np.uint64], " M"]:
        """Sort key of the tiles in depth-first order of the hierarchy."""
        levels = np.array([(code.bit_length() - 4) // 2 for code in map(int, self.codes)], np.uint64)
        return self.codes << (2 * (MAX_DEPTH - levels)).astype(np.uint64)

    @cached_property
    def solid_angles(self) -> Shaped[F64, " M"]:
        """Solid angle of each tile, sr."""
        return solid_angles(self.corners)

    @cached_property
    def centroids(self) -> Shaped[F64, "M 3"]:
        """Unit direction to the center of each tile."""
        return unit(self.corners.mean(axis=1))

    def locate(self, directions: Shaped[F64, "n 3"]) -> Shaped[NDArray[np.int32], " n"]:
        """Return the tile of each direction; a direction on an edge has exactly one."""
        edges, children = self._tree
        tile_index = np.empty(len(directions), np.int32)
        parallel_for_chunks(
            lambda start, stop: _locate(directions, edges, children, start, stop, tile_index), len(directions)
        )
        return tile_index

    @cached_property
    def _tree(self) -> tuple[F64, NDArray[np.int32]]:
        """The normals of the edges of each inner node's middle child (N, 3, 3), and its children (N, 4).

        The first eight nodes are the octants. A child below zero is tile −1 − child.
        """
        index = {code: -1 - tile for tile, code in enumerate(map(int, self.codes))}
        inner = {code >> shift for code in index for shift in range(2, code.bit_length() - 3, 2)}
        roots = [8 + octant for octant in range(8)]
        nodes = roots + sorted(inner.difference(roots))
        index.update((node, k) for k, node in enumerate(nodes) if node not in index)
        children = np.zeros((len(nodes), 4), np.int32)
        for k, node in enumerate(nodes):
            if index[node] < 0:  # the octant is a tile itself
                children[k] = index[node]
            else:
                children[k] = [index[4 * node + child] for child in range(4)]
        return middle_edges(_corners(np.array(nodes, np.uint64))), children


def _corners(codes: NDArray[np.uint64]) -> F64:
    """Return the corners of n nodes of the hierarchy. (n, 3, 3)"""
    levels = np.array([(code.bit_length() - 4) // 2 for code in map(int, codes)], np.uint64)
    corners = np.asarray(_OCTAHEDRON[_OCTANTS[(codes >> 2 * levels) - 8]], np.float64)
    for level in range(int(levels.max(initial=0))):
        deeper = np.nonzero(levels > level)[0]
        child = (codes[deeper] >> 2 * (levels[deeper] - level - 1)) & 3
        corners[deeper] = children_of(corners[deeper])[np.arange(len(deeper)), child]
    return corners


def children_of(corners: F64) -> F64:
    """Return the corners of the four children of triangles (n, 3, 3). (n, 4, 3, 3)"""
    six_points = np.concatenate([corners, _middles(corners)], axis=1)
    return np.asarray(six_points[:, _CHILDREN], np.float64)


def _middles(corners: F64) -> F64:
    """Return the directions of the midpoints of the edges ab, bc, ca of triangles (n, 3, 3). (n, 3, 3)"""
    return unit(corners + corners[:, (1, 2, 0)])


def middle_edges(corners: F64) -> F64:
    """Return the normals of the edges of middle children, each toward the corner that it cuts off. (n, 3, 3)"""
    middles = _middles(corners)
    return np.cross(middles, middles[:, (2, 0, 1)])


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def child_at(d, edges):  # type: ignore[no-untyped-def]
    """Return the child that contains a direction: 0, 1, 2 at the corners, 3 in the middle.

    The middle child's three edges decide: outside edge k means child k. Every direction gets exactly one child, even
    if rounding puts it on an edge.
    """
    for k in range(3):
        if edges[k, 0] * d[0] + edges[k, 1] * d[1] + edges[k, 2] * d[2] > 0:
            return k
    return 3


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _locate(directions, edges, children, start, stop, tile_index):  # type: ignore[no-untyped-def]
    for n in range(start, stop):
        d = directions[n]
        node = 4 * (d[0] >= 0) + 2 * (d[1] >= 0) + (d[2] >= 0)
        while node >= 0:
            node = children[node, child_at(d, edges[node])]
        tile_index[n] = -1 - node
