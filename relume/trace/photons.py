"""Importance photons: where light that reaches the picture by reflection comes from.

Paths start at the pictures' own points and go backward, as gather rays do; what they hit after the first surface is
what gather rays will hit (backward photon shooting, Nguyen 2010, after Hašan 2006).

Where surfaces touch, rays fly a few pixels only, and what they hit fills much of the hemisphere: paths that fly so
short a way are split, and split again where it is a quarter of that, so that cells are small along contacts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.scene.model import Camera, Scene
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, camera_directions, trace_from
from relume.trace.surface import Surface, any_tangent, surface_at

F32 = NDArray[np.float32]

_BOUNCES = 3
_PATHS_A_PASS = 1 << 15
_CONTACT_PIXELS = 12  # flights shorter than this many pixels are split
_SPLIT, _SPLITS = 8, 2
_CONTACT_SHARE = 0.25  # of all photons, at most
_MOST_PASSES = 64  # of paths that nearly all leave the scene no more are worth their time


@dataclass(frozen=True)
class Photons:
    """Hits of paths, the first surface seen left out.

    Attributes:
        hits: on triangles, all of them. directions: in which they were hit. (n, 3) float32
    """

    hits: Hits
    directions: F32

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Photons:
        """Some of them."""
        hits = self.hits
        return Photons(Hits(hits.face[which], hits.uv[which], hits.distance[which]), self.directions[which])


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
    anywhere: list[Photons] = []
    at_contacts: list[Photons] = []
    for _ in range(_MOST_PASSES):
        for camera in cameras:
            found, near = _walk(geometry, camera, size, num_paths, rng)
            anywhere += found
            at_contacts += near
        if sum(len(photons.directions) for photons in anywhere) >= num_photons:
            break
    short = _some(at_contacts, int(_CONTACT_SHARE * num_photons), rng)
    return _joined([short, _some(anywhere, num_photons - len(short.directions), rng)])


def _joined(parts: Sequence[Photons]) -> Photons:
    columns = zip(*((p.hits.face, p.hits.uv, p.hits.distance, p.directions) for p in parts), strict=True)
    face, uv, distance, directions = (np.concatenate(column) for column in columns)
    return Photons(Hits(face, uv, distance), directions)


def _some(parts: Sequence[Photons], count: int, rng: np.random.Generator) -> Photons:
    """A random subset, its order kept."""
    all_of_them = _joined(parts)
    return all_of_them.rows(np.sort(rng.permutation(len(all_of_them.directions))[:count]))


def _walk(
    geometry: Geometry, camera: Camera, size: tuple[int, int], num_paths: int, rng: np.random.Generator
) -> tuple[list[Photons], list[Photons]]:
    """Paths through random positions of a picture; what they hit after each bounce, and what split ones do."""
    width, height = size
    x, y = rng.random((2, num_paths), np.float32) * np.array([[width], [height]], np.float32)
    hits, directions = _hits(geometry, camera.to_world[:3, 3].astype(np.float32), camera_directions(camera, size, x, y))
    surface = surface_at(geometry, hits, directions)
    pixel = np.float32(2 * math.tan(camera.yfov / 2) / height)
    reach = _CONTACT_PIXELS * pixel * hits.distance
    found, near = [], _split(geometry, surface, reach, rng)
    for _ in range(_BOUNCES):
        hits, directions = _hits(geometry, surface.position, cosine_directions(surface.normal, rng))
        found.append(Photons(hits, directions))
        surface = surface_at(geometry, hits, directions)
    return found, near


def _hits(geometry: Geometry, origin: F32, directions: F32) -> tuple[Hits, F32]:
    """Hits of the rays that hit anything, and these rays' directions."""
    photons = Photons(trace_from(geometry.embree, origin, directions), directions)
    photons = photons.rows(photons.hits.face >= 0)
    return photons.hits, photons.directions


def _split(geometry: Geometry, surface: Surface, reach: F32, rng: np.random.Generator) -> list[Photons]:
    """Photons of short flights from points, many from those that have any. reach: of the shortest, metres. (n,)"""
    position, normal, found = surface.position, surface.normal, []
    for split in range(_SPLITS + 1):
        directions = cosine_directions(normal, rng)
        hits = trace_from(geometry.embree, position, directions)
        is_short = (hits.face >= 0) & (hits.distance < reach)
        if split > 0:
            found.append(Photons(hits, directions).rows(is_short))
            reach = reach * np.float32(0.25)
            is_short &= hits.distance < reach
        position, normal, reach = (np.repeat(a[is_short], _SPLIT, axis=0) for a in (position, normal, reach))
    return found


def cosine_directions(normal: F32, rng: np.random.Generator) -> F32:
    """A random direction about each normal (n, 3), density cos θ / π. (n, 3) float32"""
    u, phi = rng.random(len(normal)), 2 * np.pi * rng.random(len(normal))
    tangent = any_tangent(normal)
    bitangent = np.cross(normal, tangent)
    x, y, z = np.sqrt(u) * np.cos(phi), np.sqrt(u) * np.sin(phi), np.sqrt(1 - u)
    return np.asarray(x[:, None] * tangent + y[:, None] * bitangent + z[:, None] * normal, np.float32)
