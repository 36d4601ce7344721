"""Importance photons: where light that reaches the picture by reflection comes from.

Paths start at the pictures' own points and go backward, as gather rays do; what they hit after the first surface is
what gather rays will hit (backward photon shooting, Nguyen 2010, after Hašan 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.scene.model import Camera, Scene
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, camera_directions, trace_from
from relume.trace.surface import any_tangent, surface_at

F32 = NDArray[np.float32]

_BOUNCES = 3
_PATHS_A_PASS = 1 << 15
_MOST_PASSES = 64  # of paths that nearly all leave the scene no more are worth their time


@dataclass(frozen=True)
class Photons:
    """Hits of paths, the first surface seen left out.

    Attributes:
        hits: on triangles, all of them. directions: in which they were hit. (n, 3) float32
    """

    hits: Hits
    directions: F32


def shoot_photons(
    scene: Scene, geometry: Geometry, views: Sequence[str], size: tuple[int, int], num_photons: int
) -> Photons:
    """`num_photons` photons, fewer where paths leave the scene too soon; seeded by the scene's id.

    Args:
        views: names of the cameras that paths start from. size: of the pictures, pixels.
    """
    rng = np.random.default_rng(int(scene.id, 16))
    cameras = [camera for camera in scene.cameras if camera.name in views]
    num_paths = max(256, _PATHS_A_PASS // len(cameras))
    found: list[Photons] = []
    for _ in range(_MOST_PASSES):
        for camera in cameras:
            found += _walk(geometry, camera, size, num_paths, rng)
        if sum(len(photons.directions) for photons in found) >= num_photons:
            break
    face, uv, distance, along = (
        np.concatenate(column)
        for column in zip(*((p.hits.face, p.hits.uv, p.hits.distance, p.directions) for p in found), strict=True)
    )
    chosen = np.sort(rng.permutation(len(face))[:num_photons])
    return Photons(Hits(face[chosen], uv[chosen], distance[chosen]), along[chosen])


def _walk(
    geometry: Geometry, camera: Camera, size: tuple[int, int], num_paths: int, rng: np.random.Generator
) -> list[Photons]:
    """Paths through random positions of a picture; what they hit after each bounce."""
    width, height = size
    x, y = rng.random((2, num_paths), np.float32) * np.array([[width], [height]], np.float32)
    directions = camera_directions(camera, size, x, y)
    origin = camera.to_world[:3, 3].astype(np.float32)
    found = []
    for bounce in range(_BOUNCES + 1):
        hits = trace_from(geometry.embree, origin, directions)
        on_surface = hits.face >= 0
        hits = Hits(hits.face[on_surface], hits.uv[on_surface], hits.distance[on_surface])
        directions = directions[on_surface]
        if bounce > 0:
            found.append(Photons(hits, directions))
        surface = surface_at(geometry, hits, directions)
        origin = surface.position
        directions = cosine_directions(surface.normal, rng)
    return found


def cosine_directions(normal: F32, rng: np.random.Generator) -> F32:
    """A random direction about each normal (n, 3), density cos θ / π. (n, 3) float32"""
    u, phi = rng.random(len(normal)), 2 * np.pi * rng.random(len(normal))
    tangent = any_tangent(normal)
    bitangent = np.cross(normal, tangent)
    x, y, z = np.sqrt(u) * np.cos(phi), np.sqrt(u) * np.sin(phi), np.sqrt(1 - u)
    return np.asarray(x[:, None] * tangent + y[:, None] * bitangent + z[:, None] * normal, np.float32)
