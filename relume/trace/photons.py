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

from relume.brdf.albedo import is_diffuse
from relume.points import Points
from relume.scene.model import Camera, Scene
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits, camera_directions, trace_from
from relume.trace.surface import surface_at
from relume.trace.tangents import any_tangent

F32 = NDArray[np.float32]

_BOUNCES = 3
_PATHS_A_PASS = 1 << 15
_CONTACT_PIXELS = 12  # flights shorter than this many pixels are split
_SPLIT, _SPLITS = 8, 3
_CONTACT_SHARE = 0.25  # of all photons, at most
_MOST_SPLIT = 1 << 15  # paths of a pass, each time they are split: among leaves all flights are short
_LOBE = 200.0  # exponent of the mirror lobes
_MIRROR_SHARE = 1 / 7  # of all photons, at most: a sixth of the others
_MIRRORED = 4  # from each point that has a highlight
_MOST_PASSES = 64  # of paths that nearly all leave the scene no more are worth their time
_FEWEST_PASSES = 2  # after which none are, if all have left it


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
    def of_lobe(hits: Hits, directions: F32, exponent: float) -> Photons:
        """Photons that left with density ∝ cos^exponent: the root mean square of their sines, √(2 / (e + 3)).

        Args:
            hits, directions: as of the attributes. exponent: e
        """
        return Photons(hits, directions, np.full(len(directions), math.sqrt(2 / (exponent + 3)), np.float32))

    def rows(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Photons:
        """Choose some of them."""
        return Photons(self.hits.rows(which), self.directions[which], self.width[which])


class _Found(NamedTuple):
    """Photons of all paths so far, by how they came about."""

    anywhere: list[Photons]
    at_contacts: list[Photons]
    in_mirrors: list[Photons]


def shoot_photons(
    scene: Scene, geometry: Geometry, views: Sequence[str], size: tuple[int, int], num_photons: int
) -> Photons:
    """Shoot photons; they are seeded by the scene's id.

    Args:
        scene: what is seen. geometry: its triangles.
        views: names of the cameras that paths start from. size: width and height of their pictures, pixels.
        num_photons: how many are wanted; there are fewer where paths leave the scene too soon.
    """
    rng = np.random.default_rng(int(scene.id, 16))
    cameras = [camera for camera in scene.cameras if camera.name in views]
    num_paths = max(256, _PATHS_A_PASS // len(cameras))
    shines = np.array([not all(map(is_diffuse, material.terms)) for material in scene.materials])
    found, num_short = _Found([], [], []), int(_CONTACT_SHARE * num_photons)
    for done in range(1, _MOST_PASSES + 1):
        for camera in cameras:
            _walk(geometry, camera, size, num_paths, num_short, shines, rng, found)
        num_found = [sum(len(photons.directions) for photons in kind) for kind in found]
        if num_found[0] >= num_photons or (done >= _FEWEST_PASSES and not any(num_found)):
            break
    short = _some(found.at_contacts, num_short, rng)
    mirrored = _some(found.in_mirrors, int(_MIRROR_SHARE * num_photons), rng)
    num_others = num_photons - len(short.directions) - len(mirrored.directions)
    return _joined([short, mirrored, _some(found.anywhere, num_others, rng)])


def _joined(parts: Sequence[Photons]) -> Photons:
    """Join photons in their order."""
    directions, width = (np.concatenate([getattr(p, name) for p in parts]) for name in ("directions", "width"))
    return Photons(Hits.joined([p.hits for p in parts]), directions, width)


def _some(parts: Sequence[Photons], count: int, rng: np.random.Generator) -> Photons:
    """Choose a random subset of so many, its order kept."""
    all_of_them = _joined(parts)
    return all_of_them.rows(np.sort(rng.permutation(len(all_of_them.directions))[:count]))


def _walk(
    geometry: Geometry,
    camera: Camera,
    size: tuple[int, int],
    num_paths: int,
    num_short: int,
    shines: NDArray[np.bool_],
    rng: np.random.Generator,
    found: _Found,
) -> None:
    """Follow paths through random positions of a picture; add what they hit, at most `num_short` of it after short
    flights. shines: whether each material does"""
    width, height = size
    x, y = rng.random((2, num_paths), np.float32) * np.array([[width], [height]], np.float32)
    hits, directions = _hits(geometry, camera.to_world[:3, 3].astype(np.float32), camera_directions(camera, size, x, y))
    surface = surface_at(geometry, hits, directions)
    pixel = np.float32(2 * math.tan(camera.yfov / 2) / height)
    reach = _CONTACT_PIXELS * pixel * hits.distance
    found.at_contacts.append(_some(_split(geometry, surface.points, reach, rng), num_short, rng))
    is_mirror = shines[geometry.face_material[hits.face]]
    found.in_mirrors.append(_mirrored(geometry, surface.points.rows(is_mirror), directions[is_mirror], rng))
    for _ in range(_BOUNCES):
        hits, directions = _hits(geometry, surface.points.position, lobe_directions(surface.points.normal, 1.0, rng))
        found.anywhere.append(Photons.of_lobe(hits, directions, 1.0))
        surface = surface_at(geometry, hits, directions)


def _hits(geometry: Geometry, origin: F32, directions: F32) -> tuple[Hits, F32]:
    """Find the hits of the rays that hit anything, and these rays' directions."""
    hits = trace_from(geometry.embree, origin, directions)
    is_hit = hits.face >= 0
    return hits.rows(is_hit), directions[is_hit]


def _mirrored(geometry: Geometry, points: Points, directions: F32, rng: np.random.Generator) -> Photons:
    """Find what points seen along directions reflect, about the mirror direction: eq. (16), Nguyen 2010."""
    position, normal = (np.repeat(a, _MIRRORED, axis=0) for a in (points.position, points.normal))
    directions = np.repeat(directions, _MIRRORED, axis=0)
    mirrored = directions - 2 * np.einsum("nc,nc->n", directions, normal)[:, None] * normal
    leaving = lobe_directions(mirrored, _LOBE, rng)
    is_above = np.einsum("nc,nc->n", leaving, normal) > 0
    return Photons.of_lobe(*_hits(geometry, position[is_above], leaving[is_above]), _LOBE)


def _split(geometry: Geometry, points: Points, reach: F32, rng: np.random.Generator) -> list[Photons]:
    """Shoot photons of short flights from points, many from those that have any. reach: what is short, metres. (n,)"""
    position, normal, found = points.position, points.normal, []
    for split in range(_SPLITS + 1):
        directions = lobe_directions(normal, 1.0, rng)
        hits = trace_from(geometry.embree, position, directions)
        is_short = (hits.face >= 0) & (hits.distance < reach)
        if split > 0:
            found.append(Photons.of_lobe(hits, directions, 1.0).rows(is_short))
            reach = reach * np.float32(0.25)
            is_short &= hits.distance < reach
        divided = np.sort(rng.permutation(np.flatnonzero(is_short))[:_MOST_SPLIT])
        position, normal, reach = (np.repeat(a[divided], _SPLIT, axis=0) for a in (position, normal, reach))
    return found


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
