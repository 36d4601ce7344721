"""Flat mirrors, and the lights that points see in them.

By a plane with the unit normal n a light in direction d is seen in v = d − 2 (d · n) n: exactly one way leads over it,
which no ray that leaves at random finds where the light is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.eye.mirrors import are_mirrors
from relume.parallel import for_shares
from relume.points import Points
from relume.scene.model import Scene
from relume.trace.geometry import Geometry
from relume.trace.primary import trace_from
from relume.trace.surface import any_tangent, places_on

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST_PLANES = 4  # of a scene
_FLAT = 0.9999  # the least cosine between a face and the normals at its corners
_LEAST_AREA = 1e-4  # of the square of the scene's diagonal
_RAYS_AT_ONCE = 1 << 18


@dataclass(frozen=True)
class FlatMirrors:
    """P planes in which mirrors lie, the largest first.

    Attributes:
        normal: unit. (P, 3) float32. offset: n · x on them. (P,) float32. material: index into the scene's. (P,) uint16
        axes: two directions along each. (P, 2, 3) float32. low, high: how far the mirrors reach along these. (P, 2)
        of_face: the plane of each of the scene's triangles; −1: none. (faces,) int8
    """

    normal: F32
    offset: F32
    material: NDArray[np.uint16]
    axes: F32
    low: F32
    high: F32
    of_face: NDArray[np.int8]

    @property
    def num_planes(self) -> int:
        """Their number P."""
        return len(self.offset)

    def holding(self, position: F32, epsilon: float) -> NDArray[np.uint8]:
        """Find the planes that points of cells lie in. (C,) uint8, 255 where in none

        Args:
            position: of the points, off the surface by about `epsilon`. (C, points, 3)
        """
        found = np.full(len(position), 255, np.uint8)
        for p in reversed(range(self.num_planes)):
            away = np.abs(position @ self.normal[p].astype(np.float64) - self.offset[p])
            along = position @ self.axes[p].T.astype(np.float64)
            inside = (along >= self.low[p] - 4 * epsilon) & (along <= self.high[p] + 4 * epsilon)
            found[(away < 4 * epsilon).all(axis=1) & inside.all(axis=(1, 2))] = p
        return found


def has_flat_mirrors(scene: Scene) -> bool:
    """Whether any surface is a mirror that may lie in a plane."""
    return bool(_may_be_flat(scene)[[mesh.material for mesh in scene.meshes]].any())


def _may_be_flat(scene: Scene) -> NDArray[np.bool_]:
    """Of each material, that it is a mirror without bumps."""
    return are_mirrors(scene.materials) & np.array([of.normal_map is None for of in scene.materials], np.bool_)


def flat_mirrors(scene: Scene, geometry: Geometry) -> FlatMirrors:
    """Find the planes of a scene's mirrors.

    Args:
        scene: with its materials. geometry: its triangles.
    """
    face = np.flatnonzero(_may_be_flat(scene)[geometry.face_material])
    normal, corners = geometry.face_normals[face], geometry.faces[face]
    bent = np.einsum("fkc,fc->fk", geometry.normals[corners], normal) < _FLAT
    face, normal, corners = (array[~bent.any(axis=1)] for array in (face, normal, corners))
    place = geometry.positions[corners].astype(np.float64)
    diagonal = float(np.linalg.norm(np.ptp(geometry.positions, axis=0)))
    offset = np.einsum("fc,fc->f", place.mean(axis=1), normal)
    keys = [geometry.face_mesh[face], *np.rint(500 * normal).T, np.rint(2000 * offset / diagonal)]
    _, group = np.unique(np.stack(keys, axis=1), axis=0, return_inverse=True)
    twice = np.linalg.norm(np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]), axis=1)
    area = np.bincount(group.ravel(), twice / 2)
    chosen = [g for g in np.argsort(-area, kind="stable")[:MOST_PLANES] if area[g] > _LEAST_AREA * diagonal**2]
    of_face, planes = np.full(len(geometry.faces), -1, np.int8), list[_Plane]()
    material = np.empty(len(chosen), np.uint16)
    for p, g in enumerate(chosen):
        rows = np.flatnonzero(group.ravel() == g)
        of_face[face[rows]] = p
        planes.append(_plane(normal[rows], place[rows]))
        material[p] = geometry.face_material[face[rows[0]]]

    def stacked(name: str, *shape: int) -> F32:
        return np.array([getattr(plane, name) for plane in planes], np.float32).reshape(-1, *shape)

    described = stacked("normal", 3), stacked("offset"), material, stacked("axes", 2, 3)
    return FlatMirrors(*described, stacked("low", 2), stacked("high", 2), of_face)


class _Plane(NamedTuple):
    """One of `FlatMirrors`."""

    normal: F64
    offset: float
    axes: F64
    low: F64
    high: F64


def _plane(normals: F32, corners: F64) -> _Plane:
    """Describe the plane of some triangles. normals: (n, 3). corners: (n, 3, 3)"""
    normal = normals.mean(axis=0, dtype=np.float64)
    normal /= np.linalg.norm(normal)
    first = any_tangent(normal[None])[0].astype(np.float64)
    axes = np.stack([first, np.cross(normal, first)])
    places = corners.reshape(-1, 3)
    along = places @ axes.T
    return _Plane(normal, float((places @ normal).mean()), axes, along.min(axis=0), along.max(axis=0))


def seen_in(normal: F32, directions: F32) -> F32:
    """Where lights are seen in planes. (P, T, 3) float32

    Args:
        normal: of the planes, unit. (P, 3). directions: to the lights, unit. (T, 3)
    """
    twice = 2 * normal.astype(np.float64) @ directions.T
    return np.asarray(directions[None] - twice[..., None] * normal[:, None], np.float32)


@nb.njit(nogil=True, cache=True)
def _may_see(position, normal, mirrors, towards, start, stop, may):  # type: ignore[no-untyped-def]
    """Mark the lights whose way over a plane from points [start, stop) meets it where mirrors are. may: (n, P T)"""
    planes, offset, axes, low, high = mirrors
    num = towards.shape[1]
    for n in range(start, stop):
        for p in range(planes.shape[0]):
            away = np.float32(0)
            for axis in range(3):
                away += planes[p, axis] * position[n, axis]
            away -= offset[p]
            for t in range(num):
                along = above = np.float32(0)
                for axis in range(3):
                    along += planes[p, axis] * towards[p, t, axis]
                    above += normal[n, axis] * towards[p, t, axis]
                if above <= 0 or along * away >= 0:
                    continue
                distance, is_inside = -away / along, True
                for k in range(2):
                    place = np.float32(0)
                    for axis in range(3):
                        place += axes[p, k, axis] * (position[n, axis] + distance * towards[p, t, axis])
                    is_inside &= low[p, k] <= place <= high[p, k]
                may[n, p * num + t] = is_inside


class Seen(NamedTuple):
    """What n points see in flat mirrors.

    Attributes:
        visible: light t in plane p is bit k & 7 of byte k >> 3, k = p T + t. (n, bytes) uint8
        num_rays: traced.
    """

    visible: NDArray[np.uint8]
    num_rays: int


def lights_in_mirrors(geometry: Geometry, mirrors: FlatMirrors, points: Points, directions: F32) -> Seen:
    """Find which lights points see in flat mirrors.

    Args:
        geometry: the scene's triangles. mirrors: of the scene. points: n of them.
        directions: to the lights, unit. (T, 3) float32
    """
    towards = seen_in(mirrors.normal, directions)
    may = np.zeros((points.num_points, mirrors.num_planes * len(directions)), np.bool_)
    described = mirrors.normal, mirrors.offset, mirrors.axes, mirrors.low, mirrors.high
    args = points.position, points.normal, described, towards
    for_shares(lambda start, stop: _may_see(*args, start, stop, may), len(may))
    point, light = np.nonzero(may)
    num_rays = 0
    for start in range(0, len(point), _RAYS_AT_ONCE):
        some = slice(start, start + _RAYS_AT_ONCE)
        found, traced = _is_free(geometry, mirrors, points.rows(point[some]), light[some], directions, towards)
        may[point[some], light[some]] = found
        num_rays += traced
    return Seen(np.packbits(may, axis=1, bitorder="little"), num_rays)


def _is_free(
    geometry: Geometry, mirrors: FlatMirrors, points: Points, light: NDArray[np.intp], directions: F32, towards: F32
) -> tuple[NDArray[np.bool_], int]:
    """Tell whether nothing is between points and mirrors, and between these and lights; and how many rays told it."""
    plane, number = np.divmod(light, len(directions))
    way = towards[plane, number]
    hits = trace_from(geometry.embree, points.position, way, points.chance)
    free = (hits.face >= 0) & (mirrors.of_face[np.maximum(hits.face, 0)] == plane)
    rows = np.flatnonzero(free)
    met, onwards = hits.rows(rows), directions[number[rows]]
    normal = mirrors.normal[plane[rows]]
    normal = normal * np.sign(np.einsum("nc,nc->n", normal, onwards))[:, None]
    chance = points.chance if len(points.chance) == 1 else points.chance[rows]
    beyond = trace_from(geometry.embree, places_on(geometry, met.face, met.uv, normal), onwards, chance)
    free[rows] = beyond.face < 0
    return free, len(way) + len(rows)
