"""The environment as spherical triangles of pre-integrated radiance: what light lies in each tile of the sphere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.light.environment import texel_directions, texel_solid_angles, turned
from relume.light.tiles import Tiles, choose_tiles, unit

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

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

    @cached_property
    def radius(self) -> F32:
        """Angle within which of its direction all of a light lies: that to its farthest corner, radians. (M,)"""
        chords = np.linalg.norm(self.nodes[:, :3].transpose(2, 1, 0) - self.direction[:, None], axis=2)
        return np.asarray(2 * np.arcsin(np.minimum(chords.max(axis=1) / 2, 1)), np.float32)


def _tangent_frame(normal: F64) -> F64:
    """Two unit vectors across a unit vector and across each other. (2, 3)"""
    aside = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = unit(np.cross(normal, aside))
    return np.stack([first, np.cross(normal, first)])


def _on_tangent_plane(directions: F64, normal: F64, frame: F64) -> F64:
    """Gnomonic projection of directions (n, 3) onto the plane that touches the sphere at `normal`. (n, 2)"""
    return np.asarray(directions @ frame.T / (directions @ normal)[:, None])


def _power_of(moment: F64, exponent: float) -> F64:
    """A symmetric positive 2 × 2 matrix to a power; a vanishing extent is held above rounding."""
    values, vectors = np.linalg.eigh(moment)
    return np.asarray((vectors * np.maximum(values, 1e-14) ** exponent) @ vectors.T)


def _matched(corners: F64, luminous: F64, directions: F64, solid_angles: F64) -> tuple[F64, F64]:
    """The triangle (3, 3) whose light, uniform, has the moments of a tile's, and the mean direction (3,).

    Args:
        corners: of the tile. luminous, directions, solid_angles: of the texels in it.
    """
    total = float(luminous.sum())
    towards = luminous @ directions
    if total <= 0 or not towards.any():
        return corners, unit(corners.mean(axis=0))
    mean = unit(towards)
    if float((corners @ mean).min()) < _TANGENT_COSINE:
        return corners, mean
    frame = _tangent_frame(mean)
    position = _on_tangent_plane(directions, mean, frame)
    centre = luminous @ position / total
    position -= centre
    # a texel is no point: its own extent counts, as that of a square of its solid angle
    extent = float(luminous @ solid_angles) / total / 12
    spread = np.einsum("n,ni,nj->ij", luminous, position, position) / total + extent * np.eye(2)
    corner = _on_tangent_plane(corners, mean, frame)
    corner -= corner.mean(axis=0)
    uniform = corner.T @ corner / 12  # second moment of a uniform triangle about its centroid
    placed = corner @ _power_of(uniform, -0.5) @ _power_of(spread, 0.5) + centre
    return unit(mean + placed @ frame), mean


def nodes_of(corners: F64) -> F32:
    """Corners (M, 3, 3) and the midpoints of their edges as kernels read them. (3 axes, 6, M) float32"""
    nodes = np.concatenate([corners, unit(corners + np.roll(corners, -1, axis=1))], axis=1)
    return np.ascontiguousarray(nodes.transpose(2, 1, 0), np.float32)


def weigh(tiles: Tiles, radiance: F32, rotation: float = 0.0) -> TriangleLights:
    """The light of an environment in each tile; the environment need not be the one the tiles were chosen for.

    Args:
        radiance: equirectangular, top row first. (height, width, 3) float32
        rotation: of the environment about +Y, degrees, counter-clockwise seen from above.
    Cost: O(texels · depth) time.
    """
    height, width, _ = radiance.shape
    directions = turned(texel_directions(height, width).reshape(-1, 3).astype(np.float64), rotation)
    solid_angles = np.repeat(texel_solid_angles(height, width), width)
    tile = tiles.locate(directions)
    order = np.argsort(tile, kind="stable")
    ends = np.cumsum(np.bincount(tile, minlength=len(tiles.codes)))
    matched, power = [], np.zeros((len(ends), 3), np.float32)
    for m, (start, stop) in enumerate(zip(np.concatenate([[0], ends[:-1]]), ends, strict=True)):
        texels = order[start:stop]
        light = radiance.reshape(-1, 3)[texels].astype(np.float64) * solid_angles[texels, None]
        power[m] = light.sum(axis=0)
        luminous = luminance(light.astype(np.float32)).astype(np.float64)
        matched.append(_matched(tiles.corners[m], luminous, directions[texels], solid_angles[texels]))
    direction = np.array([mean for _, mean in matched], np.float32)
    return TriangleLights(nodes_of(np.array([corners for corners, _ in matched])), direction, power)


def subdivide(radiance: F32, num_lights: int) -> TriangleLights:
    """Divide an environment into about `num_lights` triangles. Raises as `choose_tiles` does."""
    return weigh(choose_tiles(radiance, num_lights), radiance)
