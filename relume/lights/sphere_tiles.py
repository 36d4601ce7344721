"""Spherical triangles that tile the sphere: leaves of a hierarchy over an octahedron.

Ben-Artzi 2006, section 5.2: each triangle is split into four at its edges' midpoints where the metric of structured
importance sampling (Agarwal 2003, L · ΔΩ^b) is largest.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import cached_property

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.core.color import luminance
from relume.core.errors import PlanError
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MIN_LIGHTS, MAX_LIGHTS = 8, 65_536
MAX_DEPTH = 28  # of the hierarchy: capacity of a 64-bit code

# Agarwal 2003 uses ΔΩ^(1/4) against errors of shadows; highlights show the map itself, so that the size has more weight
# here, and a small term of plain solid angle is added, weighted by the mean radiance
# (docs/direct-light.md#environment-triangles).
SOLID_ANGLE_EXPONENT = 0.4
UNIFORM_FRACTION = 1e-2
# With light at any azimuth, a larger fraction of tiles is dim until a bright region is rotated there
# (docs/direct-light.md#environment-triangles).
_RELIGHTABLE_UNIFORM_FRACTION = 0.1

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
        return _middle_edges(_corners(np.array(nodes, np.uint64))), children


def _corners(codes: NDArray[np.uint64]) -> F64:
    """Return the corners of n nodes of the hierarchy. (n, 3, 3)"""
    levels = np.array([(code.bit_length() - 4) // 2 for code in map(int, codes)], np.uint64)
    corners = np.asarray(_OCTAHEDRON[_OCTANTS[(codes >> 2 * levels) - 8]], np.float64)
    for level in range(int(levels.max(initial=0))):
        deeper = np.nonzero(levels > level)[0]
        child = (codes[deeper] >> 2 * (levels[deeper] - level - 1)) & 3
        corners[deeper] = _children(corners[deeper])[np.arange(len(deeper)), child]
    return corners


def _children(corners: F64) -> F64:
    """Return the corners of the four children of triangles (n, 3, 3). (n, 4, 3, 3)"""
    six_points = np.concatenate([corners, _middles(corners)], axis=1)
    return np.asarray(six_points[:, _CHILDREN], np.float64)


def _middles(corners: F64) -> F64:
    """Return the directions of the midpoints of the edges ab, bc, ca of triangles (n, 3, 3). (n, 3, 3)"""
    return unit(corners + corners[:, (1, 2, 0)])


def _middle_edges(corners: F64) -> F64:
    """Return the normals of the edges of middle children, each toward the corner that it cuts off. (n, 3, 3)"""
    middles = _middles(corners)
    return np.cross(middles, middles[:, (2, 0, 1)])


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _child(d, edges):  # type: ignore[no-untyped-def]
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
            node = children[node, _child(d, edges[node])]
        tile_index[n] = -1 - node


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _find_children(texels, directions, edges, child_index):  # type: ignore[no-untyped-def]
    for k in range(texels.shape[0]):
        child_index[k] = _child(directions[texels[k]], edges)


class _Subdivision:
    """The growing hierarchy: a heap of leaves by metric."""

    def __init__(self, radiance: F32, uniform_fraction: float) -> None:
        height, width, _ = radiance.shape
        self.directions = texel_directions(height, width).reshape(-1, 3).astype(np.float64)
        self.solid_angles = np.repeat(texel_solid_angles(height, width), width)
        self.luminous = luminance(radiance.reshape(-1, 3)).astype(np.float64) * self.solid_angles
        self.uniform = uniform_fraction * float(self.luminous.sum()) / (4 * np.pi)
        self.heap: list[tuple[float, int, int, F64, NDArray[np.int64]]] = []
        self.count = 0
        sign = (self.directions >= 0).astype(np.int64)
        octant = sign[:, 0] * 4 + sign[:, 1] * 2 + sign[:, 2]
        for k in range(8):
            self._push(8 + k, _OCTAHEDRON[_OCTANTS[k]], np.nonzero(octant == k)[0])

    def _push(self, code: int, corners: F64, texels: NDArray[np.int64]) -> None:
        light = float(self.luminous[texels].sum())
        extent = float(self.solid_angles[texels].sum())
        metric = light * max(extent, 1e-12) ** SOLID_ANGLE_EXPONENT + self.uniform * extent
        # leaves with fewer than two texels have no more detail: last in the queue
        can_split = len(texels) > 1 and code.bit_length() < 4 + 2 * MAX_DEPTH
        heapq.heappush(self.heap, (-metric if can_split else 0.0, self.count, code, corners, texels))
        self.count += 1

    def split_largest(self) -> bool:
        """Replace the leaf of largest metric by its four children; return False if none can be split."""
        if self.heap[0][0] == 0.0:
            return False
        _, _, code, corners, texels = heapq.heappop(self.heap)
        child_index = np.empty(len(texels), np.int8)
        _find_children(texels, self.directions, _middle_edges(corners[None])[0], child_index)
        for child, child_corners in enumerate(_children(corners[None])[0]):
            self._push(4 * code + child, child_corners, texels[child_index == child])
        return True


def choose_tiles(radiance: Shaped[F32, "height width 3"], num_lights: int, relightable: bool = False) -> Tiles:
    """Divide the sphere into about `num_lights` triangles (the next count of the form 8 + 3k, or fewer).

    O(texels · depth) time.

    Args:
        radiance: equirectangular, top row first. num_lights: in [8, 65536].
        relightable: the environment will be rotated or exchanged: divide rings about +Y uniformly, by their mean.
    Raises:
        PlanError: `num_lights` outside [8, 65536].
    """
    if not MIN_LIGHTS <= num_lights <= MAX_LIGHTS:
        raise PlanError(f"{num_lights} lights were asked for; give {MIN_LIGHTS} to {MAX_LIGHTS}")
    if relightable:
        ring = radiance.mean(axis=1, keepdims=True, dtype=np.float64).astype(np.float32)
        tree = _Subdivision(np.broadcast_to(ring, radiance.shape), _RELIGHTABLE_UNIFORM_FRACTION)
    else:
        tree = _Subdivision(radiance, UNIFORM_FRACTION)
    while len(tree.heap) + 3 <= num_lights and tree.split_largest():
        pass
    leaves = sorted(tree.heap, key=lambda leaf: leaf[1])  # order of creation keeps neighbors together
    return Tiles(np.array([leaf[2] for leaf in leaves], np.uint64))
