"""Flat mirrors, and the lights that points see in them.

By a plane with the unit normal n a light in direction d is seen in v = d − 2 (d · n) n: exactly one way leads over it,
which no ray that leaves at random finds where the light is small.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.eye.mirrors import are_mirrors
from relume.parallel import for_shares
from relume.points import Points
from relume.scene.model import Scene
from relume.trace.geometry import Geometry
from relume.trace.on_faces import places_on
from relume.trace.primary import trace_from
from relume.trace.tangents import any_tangent
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST_PLANES = 4  # of a scene
_FLAT = 0.9999  # the least cosine between a face and the normals at its corners
_LEAST_AREA = 1e-4  # of the square of the scene's diagonal
_NEAR = 8  # times how far rays begin off surfaces: what is no farther from a plane lies in it
_RAYS_AT_ONCE = 1 << 18


class FlatMirrors(NamedTuple):
    """P planes in which mirrors lie, the largest first.

    Attributes:
        normal: unit. (P, 3) float32. offset: n · x on them. (P,) float32. material: index into the scene's. (P,) uint16
        axes: two directions along each. (P, 2, 3) float32. low, high: how far the mirrors reach along these. (P, 2)
    """

    normal: F32
    offset: F32
    material: NDArray[np.uint16]
    axes: F32
    low: F32
    high: F32

    @property
    def num_planes(self) -> int:
        """Their number P."""
        return len(self.offset)

    def off(self, plane: NDArray[np.integer] | int, place: NDArray[np.floating]) -> F64:
        """How far places are off a plane. plane: one, or one each. place: (…, 3)"""
        normal = self.normal[plane].astype(np.float64)
        return np.asarray(np.abs((place * normal).sum(axis=-1) - self.offset[plane]), np.float64)

    def holding(self, position: F32, epsilon: float) -> NDArray[np.uint8]:
        """Find the planes that points of cells lie in. (C,) uint8, 255 where in none

        Args:
            position: of the points, off the surface by about `epsilon`. (C, points, 3)
        """
        found = np.full(len(position), 255, np.uint8)
        for p in reversed(range(self.num_planes)):
            along, near = position @ self.axes[p].T.astype(np.float64), _NEAR * epsilon
            inside = (along >= self.low[p] - near) & (along <= self.high[p] + near)
            found[(self.off(p, position) < near).all(axis=1) & inside.all(axis=(1, 2))] = p
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
    place, of = geometry.positions[corners].astype(np.float64), geometry.face_material[face]
    area = geometry.face_areas[face]
    least = _LEAST_AREA * float(np.square(np.ptp(geometry.positions, axis=0)).sum())
    planes, left = list[FlatMirrors](), np.ones(len(face), np.bool_)
    for group in _by_area(normal, place, of, area, least):
        if len(planes) == MOST_PLANES:
            break
        seed = group[np.argmax(area[group])]
        if not left[seed]:
            continue  # rounding has divided a plane that is known
        plane = _plane(normal[seed], place[seed], of[seed])
        aside = np.abs(normal @ plane.normal[0]) < _FLAT
        within = (of == of[seed]) & ~aside & (plane.off(0, place) < _NEAR * geometry.epsilon).all(axis=1)
        along = place[within].reshape(-1, 3) @ plane.axes[0].T
        planes.append(plane._replace(low=along.min(axis=0)[None], high=along.max(axis=0)[None]))
        left &= ~within

    def joined(name: str, *shape: int) -> F32:
        return np.concatenate([np.empty((0, *shape)), *(getattr(plane, name) for plane in planes)]).astype(np.float32)

    its_material = np.array([plane.material[0] for plane in planes], np.uint16)
    described = joined("normal", 3), joined("offset"), its_material, joined("axes", 2, 3)
    return FlatMirrors(*described, joined("low", 2), joined("high", 2))


def _by_area(
    normal: F32, place: F64, material: NDArray[np.integer], area: F64, least: float
) -> Iterator[NDArray[np.intp]]:
    """Group triangles that lie in a plane, roughly, the largest first; none whose area is not above `least`."""
    sign = np.where(normal @ np.array([1.0, 1e-2, 1e-4]) < 0, -1, 1)  # a plane has two sides
    offset = sign * np.einsum("fc,fc->f", place.mean(axis=1), normal)
    size = max(float(np.abs(place).max(initial=0)), 1e-9)
    keys = [material, *np.rint(500 * sign * normal.T), np.rint(2000 / size * offset)]
    _, group = np.unique(np.stack(keys, axis=1), axis=0, return_inverse=True)
    total = np.bincount(group.ravel(), area)
    for g in np.argsort(-total, kind="stable"):
        if total[g] <= least:
            return
        yield np.flatnonzero(group.ravel() == g)


def _plane(normal: F32, corners: F64, material: int) -> FlatMirrors:
    """The plane of one triangle, as far as it is known. normal: (3,). corners: (3, 3)"""
    exact = normal.astype(np.float64) / np.linalg.norm(normal.astype(np.float64))
    first = any_tangent(exact[None])[0].astype(np.float64)
    axes, offset = np.stack([first, np.cross(exact, first)])[None], np.array([(corners @ exact).mean()])
    return FlatMirrors(exact[None], offset, np.array([material]), axes, *np.empty((2, 1, 2), np.float32))


def seen_in(normal: F32, directions: F32) -> F32:
    """Where lights are seen in planes. (P, T, 3) float32

    Args:
        normal: of the planes, unit. (P, 3). directions: to the lights, unit. (T, 3)
    """
    twice = 2 * normal.astype(np.float64) @ directions.T
    return np.asarray(directions[None] - twice[..., None] * normal[:, None], np.float32)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
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
    rows = np.flatnonzero(hits.face >= 0)
    place = points.position[rows] + hits.distance[rows, None].astype(np.float64) * way[rows]
    is_its = geometry.face_material[hits.face[rows]] == mirrors.material[plane[rows]]
    rows = rows[is_its & (mirrors.off(plane[rows], place) < _NEAR * geometry.epsilon)]
    free = np.zeros(len(way), np.bool_)
    met, onwards = hits.rows(rows), directions[number[rows]]
    normal = mirrors.normal[plane[rows]]
    normal = normal * np.sign(np.einsum("nc,nc->n", normal, onwards))[:, None]
    chance = points.chance if len(points.chance) == 1 else points.chance[rows]
    beyond = trace_from(geometry.embree, places_on(geometry, met.face, met.uv, normal), onwards, chance)
    free[rows] = beyond.face < 0
    return free, len(way) + len(rows)
