"""The environment as spherical triangles of pre-integrated radiance, one per tile of the sphere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import rotate_about_y, texel_directions, texel_solid_angles
from relume.core.color import luminance
from relume.lights.light_moments import LightTexels, compute_moments
from relume.lights.sphere_tiles import Tiles, solid_angles, unit
from relume.lights.tile_hierarchy import highest_ancestors, sum_inner_nodes
from relume.lights.tile_subdivision import choose_tiles

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

# moments are matched if all corners are within 37° of the mean light direction; larger triangles stay unchanged
_MIN_TANGENT_COSINE = 0.8
_MAX_LIGHTS_PER_CLUSTER = 12
_MIN_CLUSTERED_LIGHTS = 200  # with fewer lights, clusters save no time


class MergedParts(NamedTuple):
    """Parts of merged triangles: M triangles of a finer division, with their own visibility.

    Attributes:
        group: index of the merged triangle of each part.
        fraction: fraction of the merged triangle's light that each part has.
    """

    group: Shaped[NDArray[np.int32], " M"]
    fraction: Shaped[F32, " M"]


@dataclass(frozen=True)
class TriangleLights:
    """M spherical triangles with the environment's light.

    The sphere is tiled by a hierarchy of triangles. Each tile is represented by a triangle with the same light, whose
    mean direction and spread (first and second moments) are those of the light in the tile: the tile itself if the
    light is uniform, a smaller one around a bright region. Errors of highlights are then of third order in the tile's
    size instead of first (docs/direct-light.md#environment-triangles).

    Attributes:
        nodes: unit directions of the corners a, b, c and of the midpoints of ab, bc, ca, one row per axis.
        direction: mean direction of the light, and of shadow rays.
        irradiance: ∫ L dω over the tile: irradiance on a surface perpendicular to it; per channel.
        parts: parts of merged triangles, with visibility per part; None if the triangles are not merged.
        codes: code of each tile in the hierarchy, see `Tiles`; None if not needed.
    """

    nodes: Shaped[F32, "3 6 M"]
    direction: Shaped[F32, "M 3"]
    irradiance: Shaped[F32, "M 3"]
    parts: MergedParts | None = None
    codes: Shaped[NDArray[np.uint64], " M"] | None = None

    @property
    def num_lights(self) -> int:
        """Number of triangles M."""
        return int(self.nodes.shape[2])

    def empty(self) -> TriangleLights:
        """Return no lights, for an environment without direct light."""
        return self.select(np.empty(0, np.intp), self.irradiance[:0])

    def select(self, rows: Shaped[NDArray[np.intp], " N"], irradiance: Shaped[F32, "N 3"]) -> TriangleLights:
        """Select triangles, with new irradiance."""
        codes = None if self.codes is None else self.codes[rows]
        return TriangleLights(np.take(self.nodes, rows, axis=2), self.direction[rows], irradiance, codes=codes)

    @cached_property
    def nodes_by_light(self) -> Shaped[F32, "M 6 3"]:
        """The nodes, contiguous per light."""
        return np.ascontiguousarray(self.nodes.transpose(2, 1, 0))

    @cached_property
    def radius(self) -> Shaped[F32, " M"]:
        """Angle from each light's direction to its farthest corner, radians."""
        chords = np.linalg.norm(self.nodes[:, :3].transpose(2, 1, 0) - self.direction[:, None], axis=2)
        return np.asarray(2 * np.arcsin(np.minimum(chords.max(axis=1) / 2, 1)), np.float32)

    @cached_property
    def solid_angle(self) -> Shaped[F32, " M"]:
        """Solid angle of each triangle, sr: of its light, which may be smaller than its tile."""
        return solid_angles(self.nodes[:, :3].transpose(2, 1, 0).astype(np.float64)).astype(np.float32)

    @cached_property
    def variance(self) -> Shaped[F64, " M"]:
        """Variance of the directions in each light, up to a common factor."""
        middles = self.nodes[:, 3:].astype(np.float64)
        return np.asarray(np.square(middles - middles.mean(axis=1, keepdims=True)).sum(axis=(0, 1)))

    @cached_property
    def clusters(self) -> LightClusters | None:
        """Clusters of adjacent lights; None for few lights."""
        if self.codes is None or self.num_lights < _MIN_CLUSTERED_LIGHTS:
            return None
        return _cluster_lights(self, self.codes, _MAX_LIGHTS_PER_CLUSTER)


class LightClusters(NamedTuple):
    """Clusters of adjacent lights, each merged into one light for points that see the whole cluster.

    Attributes:
        lights: merged light of each of G clusters.
        first: start of each cluster in `light_index`, then the length of `light_index`.
        light_index: indices of the lights, cluster by cluster.
        between_variance: fraction of a cluster's variance between its lights; the rest is within them.
    """

    lights: TriangleLights
    first: Shaped[NDArray[np.int64], " ends"]
    light_index: Shaped[NDArray[np.int64], " P"]
    between_variance: Shaped[F32, " G"]


NO_LIGHTS = TriangleLights(np.empty((3, 6, 0), np.float32), *np.empty((2, 0, 3), np.float32))


def _sum_by_index(index: NDArray[np.integer], values: F64, num: int) -> F64:
    """Sum the values (n,) with equal index (n,), in [0, num). (num,)"""
    return np.asarray(np.bincount(index, values, num), np.float64)


def _tangent_frames(normals: F64) -> F64:
    """Return two perpendicular tangents for each of M unit vectors. (M, 2, 3)"""
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = unit(np.cross(normals, axis))
    return np.stack([first, np.cross(normals, first)], axis=1)


def _on_tangent_plane(directions: F64, normals: F64, frames: F64) -> F64:
    """Project directions (n, 3) gnomonically, each onto the tangent plane of the sphere at its normal. (n, 2)"""
    height = np.einsum("ni,ni->n", directions, normals)
    return np.asarray(np.einsum("ni,nki->nk", directions, frames) / height[:, None])


def _matrix_power(moments: F64, exponent: float) -> F64:
    """Raise symmetric positive matrices (M, 2, 2) to a power; eigenvalues are clamped to at least 1e-14."""
    values, vectors = np.linalg.eigh(moments)
    powers = np.maximum(values, 1e-14) ** exponent
    return np.asarray((vectors * powers[:, None]) @ vectors.transpose(0, 2, 1))


def match_moments(
    corners: Shaped[F64, "M 3 3"], texels: LightTexels
) -> tuple[Shaped[F64, "M 3 3"], Shaped[F64, "M 3"]]:
    """Return triangles whose uniform light has the moments of the tiles' light, and the mean direction of each.

    The mean direction is that of the light in the tile.

    Args:
        corners: corners of the tiles. texels: light in the tiles.
    """
    num_tiles = len(corners)
    total = texels.sums(texels.luminous, num_tiles)
    weighted_direction = np.stack(
        [texels.sums(texels.luminous * axis, num_tiles) for axis in texels.directions.T], axis=1
    )
    is_lit = (total > 0) & weighted_direction.any(axis=1)
    mean = unit(np.where(is_lit[:, None], weighted_direction, corners.mean(axis=1)))
    is_small = np.einsum("mci,mi->mc", corners, mean).min(axis=1) >= _MIN_TANGENT_COSINE
    fitted = np.nonzero(is_lit & is_small)[0]
    matched_corners = corners.copy()
    frames = _tangent_frames(mean[fitted])
    center, spread = compute_moments(texels, total[fitted], mean[fitted], frames, fitted)
    corner = np.stack([_on_tangent_plane(corners[fitted, c], mean[fitted], frames) for c in range(3)], axis=1)
    corner -= corner.mean(axis=1, keepdims=True)
    uniform = corner.transpose(0, 2, 1) @ corner / 12  # second moment of a uniform triangle about its centroid
    tangent_corners = corner @ _matrix_power(uniform, -0.5) @ _matrix_power(spread, 0.5) + center[:, None]
    matched_corners[fitted] = unit(mean[fitted, None] + tangent_corners @ frames)
    return matched_corners, mean


def merge_clusters(
    lights: TriangleLights, group: Shaped[NDArray[np.integer], " M"], codes: Shaped[NDArray[np.uint64], " G"]
) -> TriangleLights:
    """Merge the lights of each cluster into one with the same light, mean direction and spread.

    The merged irradiance is Σ Eₚ cos(angle to the mean direction), slightly less than Σ Eₚ, so that Σ L Ω cos θi is
    preserved wherever all parts are above the horizon.

    Args:
        lights: M lights. group: index of the cluster of each light.
        codes: code of the hierarchy node that contains each cluster.
    """
    luminous = luminance(lights.irradiance).astype(np.float64)
    corners = lights.nodes[:, :3].transpose(2, 1, 0).astype(np.float64)
    directions = lights.direction.astype(np.float64)
    texels = LightTexels(group.astype(np.int32), luminous, directions, solid_angles(corners))
    merged_corners, mean = match_moments(Tiles(codes).corners, texels)
    cosine = np.einsum("mi,mi->m", directions, mean[group])
    irradiance = np.stack([texels.sums(light * cosine, len(codes)) for light in lights.irradiance.T], axis=1)
    return TriangleLights(pack_nodes(merged_corners), mean.astype(np.float32), irradiance.astype(np.float32))


def _cluster_lights(lights: TriangleLights, codes: NDArray[np.uint64], max_lights: int) -> LightClusters:
    """Cluster 2 to `max_lights` lights below a common node. codes: code of each light's tile. (M,)"""
    inner, (num_below,) = sum_inner_nodes(codes, np.ones((1, len(codes))))
    group_codes, group, group_size = np.unique(
        highest_ancestors(codes, inner[num_below > max_lights]), return_inverse=True, return_counts=True
    )
    group_number = np.cumsum(group_size > 1) - 1
    light_index = np.argsort(group, kind="stable")
    light_index = light_index[group_size[group[light_index]] > 1]
    group_index = group_number[group[light_index]]
    members = lights.select(light_index, lights.irradiance[light_index])
    group_lights = merge_clusters(members, group_index, group_codes[group_size > 1])
    first, luminous = (
        np.searchsorted(group_index, np.arange(group_number[-1] + 2)),
        luminance(members.irradiance).astype(float),
    )
    within_variance = _sum_by_index(group_index, luminous * members.variance, group_lights.num_lights)
    total = _sum_by_index(group_index, luminous, group_lights.num_lights) * group_lights.variance
    within_fraction = np.divide(within_variance, total, out=np.ones_like(within_variance), where=total > 0)
    between_variance = np.clip(1 - within_fraction, 0, 1).astype(np.float32)
    return LightClusters(group_lights, first.astype(np.int64), light_index.astype(np.int64), between_variance)


def pack_nodes(corners: Shaped[F64, "M 3 3"]) -> Shaped[F32, "3 6 M"]:
    """Return corners and edge midpoints in the layout of the kernels."""
    nodes = np.concatenate([corners, unit(corners + np.roll(corners, -1, axis=1))], axis=1)
    return np.ascontiguousarray(nodes.transpose(2, 1, 0), np.float32)


@dataclass(frozen=True)
class EnvironmentTexels:
    """Directions and light of the texels of an environment, before any rotation.

    Attributes:
        light: radiance × solid angle. luminous: luminance of `light`. directions: unit directions of the texels.
        solid_angles: solid angles of the texels, sr.
    """

    light: Shaped[F64, "n 3"]
    luminous: Shaped[F64, " n"]
    directions: Shaped[F64, "n 3"]
    solid_angles: Shaped[F64, " n"]

    @classmethod
    def from_radiance(cls, radiance: Shaped[F32, "height width 3"]) -> Self:
        """Return the texels of an equirectangular map, top row first."""
        height, width, _ = radiance.shape
        directions = texel_directions(height, width).reshape(-1, 3).astype(np.float64)
        texel_angles = np.repeat(texel_solid_angles(height, width), width)
        light = radiance.reshape(-1, 3).astype(np.float64) * texel_angles[:, None]
        luminous = luminance(light.astype(np.float32)).astype(np.float64)
        return cls(light, luminous, directions, texel_angles)


def integrate_environment(tiles: Tiles, environment: EnvironmentTexels, rotation: float = 0.0) -> TriangleLights:
    """Integrate the light of an environment over each tile; the tiles may have been chosen for another environment.

    Takes O(texels · depth) time.

    Args:
        tiles: M tiles of the sphere. environment: texels of the environment.
        rotation: rotation of the environment about +Y, degrees, counterclockwise from above.
    """
    directions = rotate_about_y(environment.directions, rotation)
    texels = LightTexels(tiles.locate(directions), environment.luminous, directions, environment.solid_angles)
    irradiance = np.stack([texels.sums(light, len(tiles.codes)) for light in environment.light.T], axis=1)
    corners, mean = match_moments(tiles.corners, texels)
    return TriangleLights(
        pack_nodes(corners), mean.astype(np.float32), irradiance.astype(np.float32), codes=tiles.codes
    )


def tessellate_environment(radiance: Shaped[F32, "height width 3"], num_lights: int) -> TriangleLights:
    """Divide an environment into about `num_lights` triangles. Raises PlanError if it is outside [8, 65536]."""
    return integrate_environment(choose_tiles(radiance, num_lights), EnvironmentTexels.from_radiance(radiance))
