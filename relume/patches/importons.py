"""Importons: photons of importance, traced from the camera; their density guides where patches are small.

Paths start at the visible surfaces and go backward, like gather rays; their hits after the first surface are the
importons (backward photon shooting, Nguyen 2010, section 5.1, after Hašan 2006). At visible surfaces with a highlight
some paths leave about the mirror direction, so that patches are small where highlights show them.

Near contacts of surfaces rays travel a few pixels only, and their hits fill much of the hemisphere: such short paths
are split, again at a quarter and at a sixteenth of the distance, so that patches are small along contacts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import scatters_diffusely
from relume.raytrace.camera_rays import Hits, camera_directions, near_distances, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.scene.model import Camera, Scene

F32 = NDArray[np.float32]

_BOUNCES = 3
_PATHS_PER_PASS = 1 << 15
_CONTACT_PIXELS = 12  # shorter paths, in pixels, are split
_SPLIT_FACTOR, _NUM_SPLITS = 8, 3
_MAX_CONTACT_FRACTION = 0.25  # of all importons
_MAX_SPLIT_PATHS = 1 << 15  # split paths per pass and level: in foliage all paths are short
_LOBE_EXPONENT = 200.0  # of the mirror lobes
_MAX_MIRROR_FRACTION = 1 / 7  # of all importons: a sixth of the others
_MIRROR_RAYS_PER_POINT = 4  # from each point with a highlight
_MAX_PASSES = 64  # bounds the time if nearly all paths leave the scene
_MIN_PASSES = 2  # passes before giving up if all paths leave the scene


@dataclass(frozen=True)
class Importons:
    """Hits of paths from the camera, without the first visible surface.

    Attributes:
        hits: hits on triangles. directions: directions of the incoming rays.
        width: width of the lobe, radians; times the distance it is the footprint that one ray does not resolve.
    """

    hits: Hits
    directions: Shaped[F32, "n 3"]
    width: Shaped[F32, " n"]

    @staticmethod
    def from_lobe(hits: Hits, directions: Shaped[F32, "n 3"], exponent: float) -> Importons:
        """Create importons from the hits of rays with density ∝ cos^exponent.

        Their width is the root mean square of the sine between `directions` and the lobe, √(2 / (exponent + 3)).
        """
        return Importons(hits, directions, np.full(len(directions), math.sqrt(2 / (exponent + 3)), np.float32))

    def rows(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Importons:
        """Select importons."""
        return Importons(self.hits.rows(rows), self.directions[rows], self.width[rows])


class _ImportonSets(NamedTuple):
    """Importons of all paths so far, by the kind of path."""

    diffuse: list[Importons]
    contact: list[Importons]
    mirror: list[Importons]


def trace_importons(
    scene: Scene, geometry: SceneBuffers, views: Sequence[str], size: tuple[int, int], num_importons: int
) -> Importons:
    """Trace importons, seeded by the scene's id.

    Args:
        scene: scene of the views. geometry: its triangles.
        views: names of the cameras that paths start from. size: width and height of their images, pixels.
        num_importons: requested; there are fewer if paths leave the scene too soon.
    """
    rng = np.random.default_rng(int(scene.id, 16))
    cameras = [camera for camera in scene.cameras if camera.name in views]
    num_paths = max(256, _PATHS_PER_PASS // len(cameras))
    is_glossy = np.array([not all(map(scatters_diffusely, material.terms)) for material in scene.materials])
    importon_sets, max_contact = _ImportonSets([], [], []), int(_MAX_CONTACT_FRACTION * num_importons)
    for num_passes in range(1, _MAX_PASSES + 1):
        for camera in cameras:
            _trace_paths(geometry, camera, size, num_paths, max_contact, is_glossy, rng, importon_sets)
        counts = [sum(len(importons.directions) for importons in batches) for batches in importon_sets]
        if counts[0] >= num_importons or (num_passes >= _MIN_PASSES and not any(counts)):
            break
    contact_importons = _random_subset(importon_sets.contact, max_contact, rng)
    mirror_importons = _random_subset(importon_sets.mirror, int(_MAX_MIRROR_FRACTION * num_importons), rng)
    num_diffuse = num_importons - len(contact_importons.directions) - len(mirror_importons.directions)
    return _concatenate([contact_importons, mirror_importons, _random_subset(importon_sets.diffuse, num_diffuse, rng)])


def _concatenate(batches: Sequence[Importons]) -> Importons:
    """Concatenate importons in order."""
    directions, width = (
        np.concatenate([getattr(batch, name) for batch in batches]) for name in ("directions", "width")
    )
    return Importons(Hits.concatenate([batch.hits for batch in batches]), directions, width)


def _random_subset(batches: Sequence[Importons], count: int, rng: np.random.Generator) -> Importons:
    """Select a random subset in order."""
    importons = _concatenate(batches)
    return importons.rows(np.sort(rng.permutation(len(importons.directions))[:count]))


def _trace_paths(
    geometry: SceneBuffers,
    camera: Camera,
    size: tuple[int, int],
    num_paths: int,
    max_contact: int,
    is_glossy: NDArray[np.bool_],
    rng: np.random.Generator,
    importon_sets: _ImportonSets,
) -> None:
    """Trace paths through random positions of an image; add their hits, at most `max_contact` of short paths."""
    width, height = size
    x, y = rng.random((2, num_paths), np.float32) * np.array([[width], [height]], np.float32)
    directions = camera_directions(camera, size, x, y)
    hits, directions = _trace_hits(
        geometry, camera.to_world[:3, 3].astype(np.float32), directions, near_distances(camera, directions)
    )
    surface = surface_at(geometry, hits, directions)
    pixel_angle = np.float32(2 * math.tan(camera.yfov / 2) / height)
    reach = _CONTACT_PIXELS * pixel_angle * hits.distance
    importon_sets.contact.append(
        _random_subset(_trace_short_paths(geometry, surface.points, reach, rng), max_contact, rng)
    )
    is_mirror = is_glossy[geometry.face_material[hits.face]]
    importon_sets.mirror.append(
        _trace_mirror_lobes(geometry, surface.points.rows(is_mirror), directions[is_mirror], rng)
    )
    for _ in range(_BOUNCES):
        hits, directions = _trace_hits(
            geometry, surface.points.position, lobe_directions(surface.points.normal, 1.0, rng)
        )
        importon_sets.diffuse.append(Importons.from_lobe(hits, directions, 1.0))
        surface = surface_at(geometry, hits, directions)


def _trace_hits(geometry: SceneBuffers, origin: F32, directions: F32, start: F32 | None = None) -> tuple[Hits, F32]:
    """Return the hits of rays that hit anything, and their directions."""
    hits = trace_rays(geometry.embree, origin, directions, start=start)
    is_hit = hits.face >= 0
    return hits.rows(is_hit), directions[is_hit]


def _trace_mirror_lobes(
    geometry: SceneBuffers, points: SurfacePoints, directions: F32, rng: np.random.Generator
) -> Importons:
    """Trace rays about the mirror direction from visible points: eq. (16), Nguyen 2010."""
    position, normal = (np.repeat(a, _MIRROR_RAYS_PER_POINT, axis=0) for a in (points.position, points.normal))
    directions = np.repeat(directions, _MIRROR_RAYS_PER_POINT, axis=0)
    mirror_directions = directions - 2 * np.einsum("nc,nc->n", directions, normal)[:, None] * normal
    lobe_rays = lobe_directions(mirror_directions, _LOBE_EXPONENT, rng)
    is_above = np.einsum("nc,nc->n", lobe_rays, normal) > 0
    return Importons.from_lobe(*_trace_hits(geometry, position[is_above], lobe_rays[is_above]), _LOBE_EXPONENT)


def _trace_short_paths(
    geometry: SceneBuffers, points: SurfacePoints, reach: F32, rng: np.random.Generator
) -> list[Importons]:
    """Split short paths at points. reach: maximum length of a short path, meters. (n,)"""
    position, normal, importons = points.position, points.normal, []
    for round_index in range(_NUM_SPLITS + 1):
        directions = lobe_directions(normal, 1.0, rng)
        hits = trace_rays(geometry.embree, position, directions)
        is_short = (hits.face >= 0) & (hits.distance < reach)
        if round_index > 0:
            importons.append(Importons.from_lobe(hits, directions, 1.0).rows(is_short))
            reach = reach * np.float32(0.25)
            is_short &= hits.distance < reach
        split_rows = np.sort(rng.permutation(np.flatnonzero(is_short))[:_MAX_SPLIT_PATHS])
        position, normal, reach = (np.repeat(a[split_rows], _SPLIT_FACTOR, axis=0) for a in (position, normal, reach))
    return importons


def lobe_directions(axis: Shaped[F32, "n 3"], exponent: float, rng: np.random.Generator) -> Shaped[F32, "n 3"]:
    """Sample a random unit direction about each axis, with density ∝ cos^exponent.

    Args:
        axis: unit. exponent: at least 0; 1 is the cosine's. rng: random generator.
    """
    z, phi = (1 - rng.random(len(axis))) ** (1 / (exponent + 1)), 2 * np.pi * rng.random(len(axis))
    across = np.sqrt(1 - z * z)
    tangent = any_tangent(axis)
    bitangent = np.cross(axis, tangent)
    x, y = across * np.cos(phi), across * np.sin(phi)
    return np.asarray(x[:, None] * tangent + y[:, None] * bitangent + z[:, None] * axis, np.float32)
