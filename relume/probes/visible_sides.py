"""Sides of faces that light or a camera can reach from outside, or from inside a room with a camera.

Rays leave both sides of every face. A ray that hits another side connects the two; a ray that leaves the scene connects
its side with the outside. Sides connected with the outside or with a camera are visible; the inner sides of solids are
connected only with each other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from relume.patches.importons import lobe_directions
from relume.raytrace.barycentric import positions_on_faces
from relume.raytrace.camera_rays import Hits, camera_directions, near_distances, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Camera

F32 = NDArray[np.float32]

_MAX_RAYS = 2_000_000
_RAYS_PER_SIDE = 8
_CAMERA_PIXELS = (64, 64)
_RAYS_PER_BATCH = 250_000


def visible_sides(geometry: SceneBuffers, cameras: Sequence[Camera], seed: int) -> Shaped[NDArray[np.bool_], "faces 2"]:
    """Find the visible sides of faces.

    Args:
        geometry: geometry of the scene. cameras: cameras of the bake. seed: seed of the rays.
    Returns:
        Side 0 is the one from which the corners are counterclockwise.
    """
    num_faces = len(geometry.faces)
    outside, rng, normals = 2 * num_faces, np.random.default_rng(seed), geometry.face_normals
    edges = [_trace_from_camera(geometry, normals, camera, outside) for camera in cameras]
    for _ in range(max(1, min(_RAYS_PER_SIDE, _MAX_RAYS // (2 * num_faces)))):
        for start in range(0, 2 * num_faces, _RAYS_PER_BATCH):
            sides = np.arange(start, min(start + _RAYS_PER_BATCH, 2 * num_faces))
            edges.append(_trace_from_sides(geometry, normals, sides, outside, rng))
    source, target = np.concatenate(edges, axis=1)
    graph = coo_array((np.ones(len(source), np.bool_), (source, target)), shape=(outside + 1, outside + 1))
    _, component = connected_components(graph, directed=False)
    return np.asarray(component[:outside] == component[outside]).reshape(num_faces, 2)


def _hit_sides(normals: F32, hits: Hits, directions: F32, outside: int) -> NDArray[np.int64]:
    """Return the sides that rays hit; `outside` if they leave the scene."""
    is_back_side = np.einsum("nc,nc->n", normals[np.maximum(hits.face, 0)], directions) > 0
    return np.where(hits.face >= 0, 2 * hits.face.astype(np.int64) + is_back_side, outside)


def _trace_from_sides(
    geometry: SceneBuffers, normals: F32, sides: NDArray[np.int64], outside: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Trace one ray from a random point of each side. (2, rays): the side, and the side it hits"""
    face = (sides // 2).astype(np.int32)
    normal = normals[face] * np.where(sides % 2 == 0, 1, -1)[:, None].astype(np.float32)
    root, v = np.sqrt(rng.random(len(sides))), rng.random(len(sides))
    uv = np.stack([root * (1 - v), root * v], axis=1).astype(np.float32)
    directions = lobe_directions(normal, 1.0, rng)
    hits = trace_rays(geometry.embree, positions_on_faces(geometry, face, uv, normal), directions)
    return np.stack([sides, _hit_sides(normals, hits, directions, outside)])


def _trace_from_camera(geometry: SceneBuffers, normals: F32, camera: Camera, outside: int) -> NDArray[np.int64]:
    """Connect the sides that a camera sees with the outside. (2, rays)"""
    width, height = _CAMERA_PIXELS
    y, x = np.divmod(np.arange(width * height), width)
    directions = camera_directions(camera, _CAMERA_PIXELS, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    position, start = camera.to_world[:3, 3].astype(np.float32), near_distances(camera, directions)
    hits = trace_rays(geometry.embree, position, directions, start=start)
    sides = _hit_sides(normals, hits, directions, outside)
    return np.stack([np.full(len(sides), outside), sides])
