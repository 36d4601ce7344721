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

# Agarwal 2003 use ΔΩ^(1/4) against the error of shadows; highlights show the map itself, so that size counts more
# here, and a little of plain solid angle is added, weighted by the mean radiance (docs/adr/0010-light-metric.md).
_SOLID_ANGLE_EXPONENT = 0.4
_UNIFORM_SHARE = 1e-2
_TANGENT_COSINE = (
    0.8  # triangles within 37° of their light are matched in its tangent plane; larger ones stay as they are
)


@dataclass(frozen=True)
class TriangleLights:
    """M spherical triangles with the environment's light.

    The sphere is tiled by a hierarchy of triangles. What is kept of a tile is the triangle with the same light, whose
    mean direction and spread (first and second moments) are those of the light in the tile: the same tile where the
    light is uniform, a smaller one around a lamp. Highlights then err in the third order of the tile's size instead
    of the first (docs/adr/0011-moment-matched-lights.md).

    Attributes:
        nodes: unit directions of the corners a, b, c and of the midpoints of ab, bc, ca. (3 axes, 6, M) float32
        direction: mean direction of the light; shadow rays go there. (M, 3) float32
        power: radiance integrated over the tile, per colour. (M, 3) float32
    """

    nodes: F32
    direction: F32
    power: F32

    @property
    def num_lights(self) -> int:
        """M."""
        return int(self.nodes.shape[2])


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


def _tangent_frame(normal: F64) -> F64:
    """Two unit vectors across a unit vector and across each other. (2, 3)"""
    aside = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = _unit(np.cross(normal, aside))
    return np.stack([first, np.cross(normal, first)])


def _on_tangent_plane(directions: F64, normal: F64, frame: F64) -> F64:
    """Gnomonic projection of directions (n, 3) onto the plane that touches the sphere at `normal`. (n, 2)"""
    return np.asarray(directions @ frame.T / (directions @ normal)[:, None])


def _power_of(moment: F64, exponent: float) -> F64:
    """A symmetric positive 2 × 2 matrix to a power; a vanishing extent is held above rounding."""
    values, vectors = np.linalg.eigh(moment)
    return np.asarray((vectors * np.maximum(values, 1e-14) ** exponent) @ vectors.T)


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

    def matched(self, face: tuple[int, int, int], texels: NDArray[np.int64]) -> tuple[F64, F64]:
        """The triangle (3, 3) whose light, uniform, has the moments of a tile's, and the mean direction (3,)."""
        corners = np.asarray([self.vertices[v] for v in face])
        centroid = _unit(corners.mean(axis=0))
        luminous = self.luminous[texels]
        total = float(luminous.sum())
        if total <= 0:
            return corners, centroid
        towards = luminous @ self.directions[texels]
        if not towards.any():
            return corners, centroid
        mean = _unit(towards)
        if float((corners @ mean).min()) < _TANGENT_COSINE:
            return corners, mean
        frame = _tangent_frame(mean)
        position = _on_tangent_plane(self.directions[texels], mean, frame)
        centre = luminous @ position / total
        position -= centre
        # a texel is no point: its own extent counts, as that of a square of its solid angle
        extent = float(luminous @ self.solid_angles[texels]) / total / 12
        spread = np.einsum("n,ni,nj->ij", luminous, position, position) / total + extent * np.eye(2)
        corner = _on_tangent_plane(corners, mean, frame)
        corner -= corner.mean(axis=0)
        uniform = corner.T @ corner / 12  # second moment of a uniform triangle about its centroid
        placed = corner @ _power_of(uniform, -0.5) @ _power_of(spread, 0.5) + centre
        return _unit(mean + placed @ frame), mean

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
    matched = [tree.matched(leaf[2], leaf[3]) for leaf in leaves]
    corners = np.array([corner for corner, _ in matched])
    nodes = np.concatenate([corners, _unit(corners + np.roll(corners, -1, axis=1))], axis=1)
    return TriangleLights(
        np.ascontiguousarray(nodes.transpose(2, 1, 0), np.float32),
        np.array([direction for _, direction in matched], np.float32),
        np.array([tree.power[leaf[3]].sum(axis=0) for leaf in leaves], np.float32),
    )
