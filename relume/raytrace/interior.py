"""Rooms: surfaces in the way of a moving camera, what encloses a point, and a camera inside a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.alpha_filter import STOP_AT_OPAQUE
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.ray_origins import OriginMesh
from relume.scene.model import Camera

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

INTERIOR_YFOV = float(np.radians(65.0))
_CLOSED, _OPEN_SIDE = 0.9, 0.6  # fraction of the directions that surfaces close: of a room, of a room with an open side
_MIN_FRONT = 0.5  # of the surfaces of a room show their outer side; those of a solid show their inner side
_GRID = 8, 4, 8  # candidate positions
_NUM_DIRECTIONS, _NUM_AZIMUTHS = 96, 32
_MIN_ROOM = 1e-3  # median distance of a room's walls; fraction of the scene's diagonal
_CAMERA_HEIGHT_M, _WALL_MARGIN = 1.6, 0.15  # above the floor; fraction of the room's depth between camera and wall


class Obstacle(NamedTuple):
    """The first surface on a path. length: path length to it, meters. face: its triangle."""

    length: float
    face: int


class Surroundings(NamedTuple):
    """Surfaces around a point.

    Attributes:
        enclosed: fraction of all directions in which there is a surface.
        front: fraction of these surfaces that show their outer side.
        distance: median distance of these surfaces, meters. nearest: least distance; infinite if there is none.
        face: the nearest triangle, -1 if there is none.
    """

    enclosed: float
    front: float
    distance: float
    nearest: float
    face: int

    @property
    def is_room(self) -> bool:
        """True in a closed room, false inside a solid and in the open."""
        return self.enclosed >= _CLOSED and self.front >= _MIN_FRONT

    @property
    def is_solid(self) -> bool:
        """True inside a closed surface whose inner side is visible in almost all directions."""
        return self.enclosed >= _CLOSED and self.front <= 1 - _CLOSED


def first_obstacle(embree: EmbreeScene, origins: OriginMesh, path: Shaped[F64, "points 3"]) -> Obstacle | None:
    """Find the first surface on a path, glass included.

    Args:
        embree, origins: the triangles. path: corners of a polyline, meters. A surface on which the first corner lies is
            ignored: a camera on a surface can leave it.
    Returns:
        The obstacle; None if the path is free.
    """
    length = np.linalg.norm(np.diff(path, axis=0), axis=1)
    rows = np.flatnonzero(length > 0)
    if len(rows) == 0:
        return None
    directions = (np.diff(path, axis=0)[rows] / length[rows, None]).astype(np.float32)
    corners, start = path[rows].astype(np.float32), np.zeros(len(rows), np.float32)
    start[0] = _distance_off_surface(embree, origins, corners[:1], directions[:1])
    hits = trace_rays(embree, corners, directions, STOP_AT_OPAQUE, start)
    blocked = np.flatnonzero((hits.face >= 0) & (hits.distance <= length[rows]))
    if len(blocked) == 0:
        return None
    first = int(blocked[0])
    return Obstacle(float(length[: rows[first]].sum() + hits.distance[first]), int(hits.face[first]))


def _distance_off_surface(embree: EmbreeScene, origins: OriginMesh, origin: F32, direction: F32) -> float:
    """Distance from which a ray no longer meets the surface on which it starts; 0 off surfaces."""
    hits = trace_rays(embree, origin, direction, STOP_AT_OPAQUE)
    face, distance = hits.face[0], float(hits.distance[0])
    if face < 0 or distance * abs(float(origins.normal[face] @ direction[0])) > origins.offset[face]:
        return 0.0
    return distance + float(origins.offset[face])


def find_surroundings(
    embree: EmbreeScene, face_normals: Shaped[F32, "faces 3"], points: Shaped[F64, "n 3"]
) -> list[Surroundings]:
    """Find what is around points, by rays in evenly distributed directions.

    Args:
        embree: the triangles. face_normals: their outer normals. points: meters.
    """
    directions = sphere_directions(_NUM_DIRECTIONS)
    num, all_directions = len(points), np.tile(directions, (len(points), 1))
    origins = np.repeat(points, _NUM_DIRECTIONS, axis=0).astype(np.float32)
    hits = trace_rays(embree, origins, all_directions, STOP_AT_OPAQUE)
    is_front = np.einsum("nc,nc->n", face_normals[np.maximum(hits.face, 0)], all_directions) < 0
    rows = zip(*(a.reshape(num, -1) for a in (hits.face, is_front, hits.distance)), strict=True)
    return [_summarize(*row) for row in rows]


def _summarize(face: NDArray[np.int32], is_front: NDArray[np.bool_], distance: F32) -> Surroundings:
    is_hit = face >= 0
    if not is_hit.any():
        return Surroundings(0.0, 0.0, np.inf, np.inf, -1)
    nearest = int(np.argmin(np.where(is_hit, distance, np.inf)))
    return Surroundings(
        float(is_hit.mean()),
        float(is_front[is_hit].mean()),
        float(np.median(distance[is_hit])),
        float(distance[nearest]),
        int(face[nearest]),
    )


def interior_camera(
    embree: EmbreeScene, face_normals: Shaped[F32, "faces 3"], bounds: Sequence[Shaped[F64, " 3"]], name: str
) -> Camera | None:
    """Place a camera in the largest room of a scene, with its back to a wall and its longest view in front.

    Args:
        embree: the triangles. face_normals: their outer normals. bounds: lowest and highest corner, meters.
        name: of the camera.
    Returns:
        The camera, at eye level above the floor; None if no place in the scene is enclosed.
    """
    low, high = (np.asarray(corner, np.float64) for corner in bounds)
    steps = [(np.arange(n) + 0.5) / n for n in _GRID]
    candidates = low + np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3) * (high - low)
    surroundings = find_surroundings(embree, face_normals, candidates)
    size = [s.enclosed * s.distance if _is_inside(s) else 0.0 for s in surroundings]
    best = int(np.argmax(size))
    if size[best] <= _MIN_ROOM * float(np.linalg.norm(high - low)):
        return None
    position = _at_camera_height(embree, candidates[best])
    position, forward = _with_back_to_wall(embree, position)
    (chosen,) = find_surroundings(embree, face_normals, position[None])
    if not _is_inside(chosen):
        position = candidates[best]
    right = np.cross(forward, (0.0, 1.0, 0.0))
    to_world = np.eye(4)
    to_world[:3] = np.column_stack([right, (0.0, 1.0, 0.0), -forward, position])
    return Camera(name, to_world, INTERIOR_YFOV)


def sees_only_outside(
    embree: EmbreeScene, face_normals: Shaped[F32, "faces 3"], camera: Camera | None, interior: Camera | None
) -> bool:
    """Return whether a scene is a closed room that a camera sees from outside.

    Args:
        embree: the triangles. face_normals: their outer normals. camera: the camera; None sees nothing.
        interior: from `interior_camera`.
    """
    if interior is None:
        return False
    positions = np.array([c.to_world[:3, 3] for c in (interior, camera) if c is not None])
    room, *outside = find_surroundings(embree, face_normals, positions)
    return room.is_room and not any(s.is_room for s in outside)


def _is_inside(surroundings: Surroundings) -> bool:
    return surroundings.enclosed >= _OPEN_SIDE and surroundings.front >= _MIN_FRONT


def _free_distances(embree: EmbreeScene, position: Shaped[F64, " 3"], directions: Shaped[F64, "n 3"]) -> F64:
    """Distances to surfaces along directions, infinite in the open."""
    hits = trace_rays(embree, position.astype(np.float32), directions.astype(np.float32), STOP_AT_OPAQUE)
    return np.asarray(hits.distance, np.float64)


def _at_camera_height(embree: EmbreeScene, position: Shaped[F64, " 3"]) -> Shaped[F64, " 3"]:
    """Move a position to eye level above the floor, at most to half of the room's height."""
    down, up = _free_distances(embree, position, np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]))
    if not np.isfinite(down):
        return position
    height = min(_CAMERA_HEIGHT_M, 0.5 * (down + up)) if np.isfinite(up) else min(_CAMERA_HEIGHT_M, down)
    return np.asarray(position + np.array([0.0, height - down, 0.0]), np.float64)


def _with_back_to_wall(embree: EmbreeScene, position: Shaped[F64, " 3"]) -> tuple[Shaped[F64, " 3"], Shaped[F64, " 3"]]:
    """Step back from the longest horizontal view; returns position and unit view direction."""
    azimuth = 2 * np.pi * np.arange(_NUM_AZIMUTHS) / _NUM_AZIMUTHS
    directions = np.stack([np.sin(azimuth), np.zeros(_NUM_AZIMUTHS), -np.cos(azimuth)], axis=1)
    free = _free_distances(embree, position, directions)
    limit = 2 * float(free[np.isfinite(free)].max(initial=0.0)) or 1.0  # an open side counts, but not as infinite
    free = np.minimum(free, limit)
    depth = free + np.roll(free, _NUM_AZIMUTHS // 2)
    # of the two ends of the longest line, the nearer one is behind
    longest = np.flatnonzero(depth >= depth.max() * (1 - 1e-6))
    view = int(longest[np.argmax(free[longest])])
    behind = depth[view] - free[view]
    return position - max(0.0, behind - _WALL_MARGIN * depth[view]) * directions[view], directions[view]


def sphere_directions(num: int) -> F32:
    """Fibonacci points on the unit sphere."""
    index = np.arange(num) + 0.5
    z, azimuth = 1 - 2 * index / num, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(azimuth), z, radius * np.sin(azimuth)], axis=1).astype(np.float32)
