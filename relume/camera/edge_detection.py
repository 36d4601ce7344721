"""Detection of pixels that need more than one ray: their surface changes, or covers them partly."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import lookup
from relume.camera.transparency_layers import TransparencyLayer
from relume.core.color import luminance
from relume.raytrace.alpha_filter import STOP_AT_OPAQUE, STOP_AT_PARTIAL
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.hit_normals import normals_at
from relume.raytrace.scene_buffers import SceneBuffers

F32 = NDArray[np.float32]

COS_NORMAL_EDGE = np.cos(np.radians(4.0))  # at larger angles one sample would alias sharp reflections
_COS_CREASE = np.cos(np.radians(20.0))
_DEPTH_EDGE = 0.02  # distance off the neighbor's plane, relative to the ray length
NO_RAY_KEY = -2  # the key of pixels without a ray in a layer
_RADIANCE_EDGE_FACTOR = 1.0  # relative to the mean radiance; smaller steps are left to texture filtering
_MAX_NORMAL_EDGE_FRACTION = 1 / 6  # of all pixels; if more qualify, as on coarse normal maps, the sharpest ones


def _edges(key: NDArray[np.int64], normal: F32, distance: F32, directions: F32) -> tuple[NDArray[np.bool_], F32]:
    """Find pixels that differ from a neighbor, and the least cosine between each pixel's normal and its neighbors'.

    Args:
        key: surface that is hit, `NO_RAY_KEY` without a ray. normal, distance: normals and distances of the hits.
        directions: directions of the rays.
            All are (height, width, …).
    Returns:
        (height, width) both
    """
    edge, cosine = np.zeros(key.shape, np.bool_), np.ones(key.shape, np.float32)
    for axis in (0, 1):
        first = tuple(slice(None, -1) if a == axis else slice(None) for a in (0, 1))
        second = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
        cosines = np.einsum("ijk,ijk->ij", normal[first], normal[second])
        depth_edges = [
            is_depth_edge(normal[base], distance[base], directions[base], distance[neighbor], directions[neighbor])
            for base, neighbor in ((first, second), (second, first))
        ]
        # require distance from both planes: a surface at a grazing angle is far from one of them
        has_rays = (key[first] != NO_RAY_KEY) & (key[second] != NO_RAY_KEY)
        is_different = (key[first] != key[second]) | (
            has_rays & ((cosines < _COS_CREASE) | (depth_edges[0] & depth_edges[1]))
        )
        for half in (first, second):
            edge[half] |= is_different
            cosine[half] = np.minimum(cosine[half], cosines)
    return edge, cosine


def is_depth_edge(
    normal: F32, distance: F32, direction: F32, neighbor_distance: F32, neighbor_direction: F32
) -> NDArray[np.bool_]:
    """True if a neighboring ray's hit is off the plane of a hit by more than a small fraction of the distance.

    Args:
        normal, distance, direction: normal and distance of a hit, and direction of its ray. (…, 3), (…), (…, 3)
        neighbor_distance, neighbor_direction: distance of the other hit, and direction of its ray, which has the same
            origin. (…), (…, 3)
    """
    with np.errstate(invalid="ignore", divide="ignore"):  # background is infinitely far
        slope = np.vecdot(direction, normal) / np.vecdot(neighbor_direction, normal)
        min_distance = np.minimum(distance, neighbor_distance)
        return np.asarray(np.abs(neighbor_distance - distance * slope) > _DEPTH_EDGE * min_distance)


def is_normal_edge(cosine: Shaped[F32, " pixels"]) -> Shaped[NDArray[np.bool_], " pixels"]:
    """True for pixels whose normals change enough for reflections to alias, at most a sixth of all pixels.

    Args:
        cosine: least cosine between normals at each pixel of an image, from `find_edge_pixels`.
    """
    is_edge = cosine < COS_NORMAL_EDGE
    max_edges = int(_MAX_NORMAL_EDGE_FRACTION * cosine.size)
    if np.count_nonzero(is_edge) > max_edges:
        is_edge &= cosine < np.partition(cosine[is_edge], max_edges)[max_edges]
    return np.asarray(is_edge)


def find_edge_pixels(
    geometry: SceneBuffers, layer: TransparencyLayer, size: tuple[int, int]
) -> tuple[Shaped[NDArray[np.bool_], " pixels"], Shaped[F32, " pixels"]]:
    """Find edge pixels in a layer.

    Args:
        geometry: the triangles. layer: layer of one ray through the center of each pixel.
        size: width and height in pixels.
    Returns:
        True for edge pixels; for the others the least cosine between the normals of a pixel and its neighbors, 1 for
        edges and the background.
    """
    width, height = size
    normals = normals_at(geometry, layer.hits, layer.directions)
    key, normal = np.full(width * height, NO_RAY_KEY), np.zeros((width * height, 3), np.float32)
    distance, directions = np.full(width * height, np.inf, np.float32), np.ones((width * height, 3), np.float32)
    key[layer.ray] = layer.key
    normal[layer.ray] = normals
    if layer.chain is None:  # rays of a mirror have no common origin, so depth steps are not comparable
        distance[layer.ray] = layer.hits.distance
    directions[layer.ray] = layer.directions
    shape = (height, width)
    key_image = key.reshape(shape)
    is_edge, cosine = _edges(
        key_image, normal.reshape(*shape, 3), distance.reshape(shape), directions.reshape(*shape, 3)
    )
    cosine[is_edge | (key_image < 0)] = 1
    return is_edge.ravel(), cosine.ravel()


def radiance_edge_threshold(environment: Shaped[F32, "h w 3"]) -> float:
    """Luminance difference of neighbors that indicates the edge of a bright region, such as a sun."""
    return _RADIANCE_EDGE_FACTOR * float(luminance(environment).mean())


def is_radiance_edge(
    layer: TransparencyLayer, environment: Shaped[F32, "h w 3"], threshold: float, size: tuple[int, int]
) -> Shaped[NDArray[np.bool_], " pixels"]:
    """True for pixels where the environment in a mirror has the edge of a bright region.

    Args:
        layer: layer of one ray through the center of each pixel. environment: its radiance.
        threshold: from `radiance_edge_threshold`. size: width and height of the image in pixels.
    """
    width, height = size
    value, rows = np.full(width * height, np.nan), np.flatnonzero(layer.hits.face < 0)
    value[layer.ray[rows]] = luminance(lookup(environment, layer.directions[rows]))
    edge = np.zeros((height, width), np.bool_)
    luminance_image = value.reshape(height, width)
    for first, second in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        # false where a neighbor shows a surface (NaN)
        is_different = np.abs(luminance_image[first] - luminance_image[second]) > threshold
        edge[first] |= is_different
        edge[second] |= is_different
    return edge.ravel()


def is_partial_coverage(
    geometry: SceneBuffers,
    origin: Shaped[F32, " 3"],
    directions: Shaped[F32, "n 3"],
    start: Shaped[F32, " n"] | None,
) -> Shaped[NDArray[np.bool_], " n"]:
    """True for rays that meet a blended surface first.

    Args:
        geometry: the triangles. origin, directions, start: of the rays, see `trace_rays`.
    """
    any_hit, opaque_hit = (
        trace_rays(geometry.embree, origin, directions, alpha_sample, start).face
        for alpha_sample in (STOP_AT_PARTIAL, STOP_AT_OPAQUE)
    )
    return np.asarray(any_hit != opaque_hit)
