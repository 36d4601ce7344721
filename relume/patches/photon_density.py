"""Importance photons: where light that reaches the picture by reflection comes from.

Paths start at the pictures' own points and go backward, as gather rays do; what they hit after the first surface is
what gather rays will hit (backward photon shooting, Nguyen 2010, section 5.1, after Hašan 2006). Where what is seen
has a highlight, some leave it about the mirror direction, so that cells are small where they are seen in it.

Where surfaces touch, rays fly a few pixels only, and what they hit fills much of the hemisphere: paths that fly so
short a way are split, and split again where it is a quarter and a sixteenth of that, so that cells are small along
contacts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import scatters_diffusely
from relume.raytrace.camera_rays import Hits, camera_directions, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.scene.model import Camera, Scene

F32 = NDArray[np.float32]

_BOUNCES = 3
_PATHS_PER_PASS = 1 << 15
_CONTACT_PIXELS = 12  # flights shorter than this many pixels are split
_SPLIT_FACTOR, _NUM_SPLITS = 8, 3
_MAX_CONTACT_FRACTION = 0.25  # of all photons, at most
_MAX_SPLIT_PATHS = 1 << 15  # paths of a pass, each time they are split: among leaves all flights are short
_LOBE_EXPONENT = 200.0  # exponent of the mirror lobes
_MAX_MIRROR_FRACTION = 1 / 7  # of all photons, at most: a sixth of the others
_MIRROR_RAYS_PER_POINT = 4  # from each point that has a highlight
_MAX_PASSES = 64  # of paths that nearly all leave the scene no more are worth their time
_MIN_PASSES = 2  # after which none are, if all have left it


@dataclass(frozen=True)
class Photons:
    """Hits of paths, the first surface seen left out.

    Attributes:
        hits: on triangles, all of them. directions: in which they were hit. (n, 3) float32
        width: of the lobe by which they were shot, radians; over the distance it is what one ray cannot tell from
            another. (n,) float32
    """

    hits: Hits
    directions: F32
    width: F32

    @staticmethod
    def from_lobe(hits: Hits, directions: F32, exponent: float) -> Photons:
        """Photons that left with density ∝ cos^exponent: the root mean square of their sines, √(2 / (e + 3)).

        Args:
            hits, directions: as of the attributes. exponent: e
        """
        return Photons(hits, directions, np.full(len(directions), math.sqrt(2 / (exponent + 3)), np.float32))

    def rows(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Photons:
        """Choose some of them."""
        return Photons(self.hits.rows(rows), self.directions[rows], self.width[rows])


class _PhotonSets(NamedTuple):
    """Photons of all paths so far, by how they came about."""

    diffuse: list[Photons]
    contact: list[Photons]
    mirror: list[Photons]


def shoot_photons(
    scene: Scene, geometry: SceneBuffers, views: Sequence[str], size: tuple[int, int], num_photons: int
) -> Photons:
    """Shoot photons; they are seeded by the scene's id.

    Args:
        scene: what is seen. geometry: its triangles.
        views: names of the cameras that paths start from. size: width and height of their pictures, pixels.
        num_photons: how many are wanted; there are fewer where paths leave the scene too soon.
    """
    rng = np.random.default_rng(int(scene.id, 16))
    cameras = [camera for camera in scene.cameras if camera.name in views]
    num_paths = max(256, _PATHS_PER_PASS // len(cameras))
    is_glossy = np.array([not all(map(scatters_diffusely, material.terms)) for material in scene.materials])
    photon_sets, max_contact = _PhotonSets([], [], []), int(_MAX_CONTACT_FRACTION * num_photons)
    for num_passes in range(1, _MAX_PASSES + 1):
        for camera in cameras:
            _trace_paths(geometry, camera, size, num_paths, max_contact, is_glossy, rng, photon_sets)
        counts = [sum(len(photons.directions) for photons in batches) for batches in photon_sets]
        if counts[0] >= num_photons or (num_passes >= _MIN_PASSES and not any(counts)):
            break
    contact_photons = _random_subset(photon_sets.contact, max_contact, rng)
    mirror_photons = _random_subset(photon_sets.mirror, int(_MAX_MIRROR_FRACTION * num_photons), rng)
    num_diffuse = num_photons - len(contact_photons.directions) - len(mirror_photons.directions)
    return _concatenate([contact_photons, mirror_photons, _random_subset(photon_sets.diffuse, num_diffuse, rng)])


def _concatenate(batches: Sequence[Photons]) -> Photons:
    """Join photons in their order."""
    directions, width = (
        np.concatenate([getattr(batch, name) for batch in batches]) for name in ("directions", "width")
    )
    return Photons(Hits.concatenate([batch.hits for batch in batches]), directions, width)


def _random_subset(batches: Sequence[Photons], count: int, rng: np.random.Generator) -> Photons:
    """Choose a random subset of so many, its order kept."""
    photons = _concatenate(batches)
    return photons.rows(np.sort(rng.permutation(len(photons.directions))[:count]))


def _trace_paths(
    geometry: SceneBuffers,
    camera: Camera,
    size: tuple[int, int],
    num_paths: int,
    max_contact: int,
    is_glossy: NDArray[np.bool_],
    rng: np.random.Generator,
    photon_sets: _PhotonSets,
) -> None:
    """Follow paths through random positions of a picture; add what they hit, at most `max_contact` of it after short
    flights. shines: whether each material does"""
    width, height = size
    x, y = rng.random((2, num_paths), np.float32) * np.array([[width], [height]], np.float32)
    hits, directions = _trace_hits(
        geometry, camera.to_world[:3, 3].astype(np.float32), camera_directions(camera, size, x, y)
    )
    surface = surface_at(geometry, hits, directions)
    pixel_angle = np.float32(2 * math.tan(camera.yfov / 2) / height)
    reach = _CONTACT_PIXELS * pixel_angle * hits.distance
    photon_sets.contact.append(
        _random_subset(_shoot_short_paths(geometry, surface.points, reach, rng), max_contact, rng)
    )
    is_mirror = is_glossy[geometry.face_material[hits.face]]
    photon_sets.mirror.append(_shoot_mirror_lobes(geometry, surface.points.rows(is_mirror), directions[is_mirror], rng))
    for _ in range(_BOUNCES):
        hits, directions = _trace_hits(
            geometry, surface.points.position, lobe_directions(surface.points.normal, 1.0, rng)
        )
        photon_sets.diffuse.append(Photons.from_lobe(hits, directions, 1.0))
        surface = surface_at(geometry, hits, directions)


def _trace_hits(geometry: SceneBuffers, origin: F32, directions: F32) -> tuple[Hits, F32]:
    """Find the hits of the rays that hit anything, and these rays' directions."""
    hits = trace_rays(geometry.embree, origin, directions)
    is_hit = hits.face >= 0
    return hits.rows(is_hit), directions[is_hit]


def _shoot_mirror_lobes(
    geometry: SceneBuffers, points: SurfacePoints, directions: F32, rng: np.random.Generator
) -> Photons:
    """Find what points seen along directions reflect, about the mirror direction: eq. (16), Nguyen 2010."""
    position, normal = (np.repeat(a, _MIRROR_RAYS_PER_POINT, axis=0) for a in (points.position, points.normal))
    directions = np.repeat(directions, _MIRROR_RAYS_PER_POINT, axis=0)
    mirror_directions = directions - 2 * np.einsum("nc,nc->n", directions, normal)[:, None] * normal
    lobe_rays = lobe_directions(mirror_directions, _LOBE_EXPONENT, rng)
    is_above = np.einsum("nc,nc->n", lobe_rays, normal) > 0
    return Photons.from_lobe(*_trace_hits(geometry, position[is_above], lobe_rays[is_above]), _LOBE_EXPONENT)


def _shoot_short_paths(
    geometry: SceneBuffers, points: SurfacePoints, reach: F32, rng: np.random.Generator
) -> list[Photons]:
    """Shoot photons of short flights from points, many from those that have any. reach: what is short, metres. (n,)"""
    position, normal, photons = points.position, points.normal, []
    for round_index in range(_NUM_SPLITS + 1):
        directions = lobe_directions(normal, 1.0, rng)
        hits = trace_rays(geometry.embree, position, directions)
        is_short = (hits.face >= 0) & (hits.distance < reach)
        if round_index > 0:
            photons.append(Photons.from_lobe(hits, directions, 1.0).rows(is_short))
            reach = reach * np.float32(0.25)
            is_short &= hits.distance < reach
        split_rows = np.sort(rng.permutation(np.flatnonzero(is_short))[:_MAX_SPLIT_PATHS])
        position, normal, reach = (np.repeat(a[split_rows], _SPLIT_FACTOR, axis=0) for a in (position, normal, reach))
    return photons


def lobe_directions(axis: F32, exponent: float, rng: np.random.Generator) -> F32:
    """Draw a random direction about each axis, with density ∝ cos^exponent.

    Args:
        axis: unit. (n, 3) float32. exponent: at least 0; 1 is the cosine's. rng: where randomness comes from.
    Returns:
        Unit directions. (n, 3) float32
    """
    z, phi = (1 - rng.random(len(axis))) ** (1 / (exponent + 1)), 2 * np.pi * rng.random(len(axis))
    across = np.sqrt(1 - z * z)
    tangent = any_tangent(axis)
    bitangent = np.cross(axis, tangent)
    x, y = across * np.cos(phi), across * np.sin(phi)
    return np.asarray(x[:, None] * tangent + y[:, None] * bitangent + z[:, None] * axis, np.float32)
