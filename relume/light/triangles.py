"""The environment as spherical triangles of pre-integrated radiance.

Ben-Artzi 2006, section 5.2: hierarchical subdivision of the sphere into triangles, each split into four where the
metric of structured importance sampling (Agarwal 2003, L · ΔΩ^b) is largest.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.errors import PlanError
from relume.light.environment import texel_directions, texel_solid_angles

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MIN_LIGHTS, MAX_LIGHTS = 8, 65_536

# Agarwal 2003 use ΔΩ^(1/4) against shadow error; highlights also show the dim parts of the map, so a little of plain
# solid angle is added, weighted by the mean radiance (docs/adr/0010-light-metric.md has the measurement).
_SOLID_ANGLE_EXPONENT = 0.25
_UNIFORM_SHARE = 1e-3


@dataclass(frozen=True)
class TriangleLights:
    """M spherical triangles that tile the sphere.

    Attributes:
        nodes: of each triangle its corners a, b, c and the midpoints of ab, bc, ca. (M, 6) int32
        node_directions: unit. (3, num_nodes) float32
        direction: mean direction of the light in the triangle; shadow rays go there. (M, 3) float32
        power: radiance integrated over the triangle, W/m² per colour. (M, 3) float32
    """

    nodes: NDArray[np.int32]
    node_directions: F32
    direction: F32
    power: F32

    @property
    def num_lights(self) -> int:
        """M."""
        return len(self.nodes)


@nb.njit(nogil=True, cache=True)
def _split(texels, directions, corners, child_of):  # type: ignore[no-untyped-def]
    """Which of the four children each texel lies in: 0, 1, 2 at the corners, 3 in the middle.

    The middle child's three edges decide: outside edge k means child k. Every texel gets exactly one child, also where
    rounding puts it on an edge. corners: edge midpoints (3, 3): ab, bc, ca.
    """
    ab, bc, ca = corners[0], corners[1], corners[2]
    edge_a = np.cross(ab, ca)  # positive towards corner a
    edge_b = np.cross(bc, ab)
    edge_c = np.cross(ca, bc)
    for k in range(texels.shape[0]):
        d = directions[texels[k]]
        if edge_a[0] * d[0] + edge_a[1] * d[1] + edge_a[2] * d[2] > 0:
            child_of[k] = 0
        elif edge_b[0] * d[0] + edge_b[1] * d[1] + edge_b[2] * d[2] > 0:
            child_of[k] = 1
        elif edge_c[0] * d[0] + edge_c[1] * d[1] + edge_c[2] * d[2] > 0:
            child_of[k] = 2
        else:
            child_of[k] = 3


def _unit(v: F64) -> F64:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True), dtype=np.float64)


_OCTAHEDRON = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)
# counter-clockwise seen from outside, and so are all their descendants
_OCTANTS = ((0, 2, 4), (4, 2, 1), (1, 2, 5), (5, 2, 0), (4, 3, 0), (1, 3, 4), (5, 3, 1), (0, 3, 5))


class _Subdivision:
    """The growing hierarchy: shared vertices, and a heap of leaves by metric."""

    def __init__(self, radiance: F32) -> None:
        height, width, _ = radiance.shape
        self.directions = texel_directions(height, width).reshape(-1, 3).astype(np.float64)
        solid_angles = np.repeat(texel_solid_angles(height, width), width)
        self.power = radiance.reshape(-1, 3).astype(np.float64) * solid_angles[:, None]
        self.luminous = luminance(self.power.astype(np.float32)).astype(np.float64)
        self.mean = float(self.luminous.sum()) / (4 * np.pi)
        self.solid_angles = solid_angles
        self.vertices: list[F64] = list(_OCTAHEDRON)
        self.midpoints: dict[tuple[int, int], int] = {}
        self.heap: list[tuple[float, int, tuple[int, int, int], NDArray[np.int64]]] = []
        self.count = 0
        sign = (self.directions >= 0).astype(np.int64)
        octant = sign[:, 0] * 4 + sign[:, 1] * 2 + sign[:, 2]
        for face in _OCTANTS:
            centre = _OCTAHEDRON[list(face)].sum(axis=0) >= 0
            code = int(centre[0]) * 4 + int(centre[1]) * 2 + int(centre[2])
            self._push(face, np.nonzero(octant == code)[0])

    def _push(self, face: tuple[int, int, int], texels: NDArray[np.int64]) -> None:
        light = float(self.luminous[texels].sum())
        extent = float(self.solid_angles[texels].sum())
        metric = light * max(extent, 1e-12) ** _SOLID_ANGLE_EXPONENT + _UNIFORM_SHARE * extent * self.mean
        # fewer than two texels hold nothing more to resolve: last in the queue
        heapq.heappush(self.heap, (-metric if len(texels) > 1 else 0.0, self.count, face, texels))
        self.count += 1

    def _midpoint(self, a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in self.midpoints:
            self.midpoints[key] = len(self.vertices)
            self.vertices.append(_unit(self.vertices[a] + self.vertices[b]))
        return self.midpoints[key]

    def nodes_of(self, face: tuple[int, int, int]) -> tuple[int, ...]:
        """Corners and edge midpoints of a face."""
        a, b, c = face
        return a, b, c, self._midpoint(a, b), self._midpoint(b, c), self._midpoint(c, a)

    def split_largest(self) -> bool:
        """Replace the leaf of largest metric by its four children; False where nothing is left to split."""
        if self.heap[0][0] == 0.0:
            return False
        _, _, (a, b, c), texels = heapq.heappop(self.heap)
        ab, bc, ca = self._midpoint(a, b), self._midpoint(b, c), self._midpoint(c, a)
        corners = np.stack([self.vertices[ab], self.vertices[bc], self.vertices[ca]])
        child_of = np.empty(len(texels), np.int8)
        _split(texels, self.directions, corners, child_of)
        for child, face in enumerate(((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))):
            self._push(face, texels[child_of == child])
        return True


def subdivide(radiance: F32, num_lights: int) -> TriangleLights:
    """Divide an environment into about `num_lights` triangles (the next count of the form 8 + 3k, or fewer).

    Args:
        radiance: equirectangular, top row first. (height, width, 3) float32
    Raises:
        PlanError: `num_lights` outside [8, 65536].
    Cost: O(texels · depth) time.
    """
    if not MIN_LIGHTS <= num_lights <= MAX_LIGHTS:
        raise PlanError(f"{num_lights} lights were asked for; give {MIN_LIGHTS} to {MAX_LIGHTS}")
    tree = _Subdivision(radiance)
    while len(tree.heap) + 3 <= num_lights and tree.split_largest():
        pass
    leaves = sorted(tree.heap, key=lambda leaf: leaf[1])  # order of creation keeps neighbours together
    nodes = np.array([tree.nodes_of(leaf[2]) for leaf in leaves], dtype=np.int32)
    vertices = np.asarray(tree.vertices)
    centroid = _unit(vertices[nodes[:, :3]].mean(axis=1))
    power = np.array([tree.power[leaf[3]].sum(axis=0) for leaf in leaves])
    direction = np.empty_like(centroid)
    for m, leaf in enumerate(leaves):
        towards = (tree.directions[leaf[3]] * tree.luminous[leaf[3], None]).sum(axis=0)
        length = float(np.linalg.norm(towards))
        direction[m] = towards / length if length > 0 else centroid[m]
    return TriangleLights(
        nodes, np.ascontiguousarray(vertices.T, np.float32), direction.astype(np.float32), power.astype(np.float32)
    )
