"""Pixels of a view that want more rays than one: what is seen changes across them, or is partly there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.equirect import lookup
from relume.camera.transparency_layers import TransparencyLayer
from relume.core.color import luminance
from relume.raytrace.alpha_filter import STOP_AT_OPAQUE, STOP_AT_PARTIAL
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.hit_normals import normals_at
from relume.raytrace.scene_buffers import SceneBuffers

F32 = NDArray[np.float32]

COS_NORMAL_EDGE = np.cos(np.radians(4.0))  # one sample would show a sharp reflection from one side only
_COS_CREASE = np.cos(np.radians(20.0))  # a crease
_DEPTH_EDGE = 0.02  # of the distance, off the plane of the surface beside
NO_RAY_KEY = -2  # the key of pixels whose ray a layer has not
_RADIANCE_EDGE_FACTOR = 1.0  # of the mean radiance around; darker details of a map are left to its own filter
_MAX_NORMAL_EDGE_FRACTION = 1 / 6  # of all pixels; where more turn, as on coarse bumps, those that turn most


def _edges(key: NDArray[np.int64], normal: F32, distance: F32, directions: F32) -> tuple[NDArray[np.bool_], F32]:
    """Find pixels that differ from a neighbour, and the least cosine between the normals of each and its neighbours.

    Args:
        key: what is hit, `NO_RAY_KEY` where a layer has no ray. normal, distance: of the hits. directions: of the rays.
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
        # off both planes: of one alone may be a surface that is seen along itself
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
    """Tell whether what another ray of an eye hits is off the plane of a hit by more than a small share of the way.

    Args:
        normal, distance, direction: of a hit, and of its ray. (…, 3), (…), (…, 3)
        neighbor_distance, neighbor_direction: of the other hit, and of its ray. (…), (…, 3)
    """
    with np.errstate(invalid="ignore", divide="ignore"):  # background is infinitely far
        slope = np.vecdot(direction, normal) / np.vecdot(neighbor_direction, normal)
        min_distance = np.minimum(distance, neighbor_distance)
        return np.asarray(np.abs(neighbor_distance - distance * slope) > _DEPTH_EDGE * min_distance)


def is_normal_edge(cosine: F32) -> NDArray[np.bool_]:
    """Find pixels that are no edges, but whose normals turn enough for reflections to alias. (pixels,)

    Args:
        cosine: of all pixels of a picture, from `find_edge_pixels`. (pixels,)
    """
    is_edge = cosine < COS_NORMAL_EDGE
    max_edges = int(_MAX_NORMAL_EDGE_FRACTION * cosine.size)
    if np.count_nonzero(is_edge) > max_edges:
        is_edge &= cosine < np.partition(cosine[is_edge], max_edges)[max_edges]
    return np.asarray(is_edge)


def find_edge_pixels(
    geometry: SceneBuffers, layer: TransparencyLayer, size: tuple[int, int]
) -> tuple[NDArray[np.bool_], F32]:
    """Find pixels that want more rays by what a layer shows.

    Args:
        geometry: the triangles. layer: of one ray through the middle of each pixel. size: width and height in pixels.
    Returns:
        (pixels,) both: whether it is an edge; else the least cosine between its normal and its neighbours', 1 where
        there is nothing that turns.
    """
    width, height = size
    normals = normals_at(geometry, layer.hits, layer.directions)
    key, normal = np.full(width * height, NO_RAY_KEY), np.zeros((width * height, 3), np.float32)
    distance, directions = np.full(width * height, np.inf, np.float32), np.ones((width * height, 3), np.float32)
    key[layer.ray] = layer.key
    normal[layer.ray] = normals
    if layer.chain is None:  # a mirror's rays have no eye in common: no steps in depth are told in it
        distance[layer.ray] = layer.hits.distance
    directions[layer.ray] = layer.directions
    shape = (height, width)
    key_image = key.reshape(shape)
    is_edge, cosine = _edges(
        key_image, normal.reshape(*shape, 3), distance.reshape(shape), directions.reshape(*shape, 3)
    )
    cosine[is_edge | (key_image < 0)] = 1
    return is_edge.ravel(), cosine.ravel()


def radiance_edge_threshold(environment: F32) -> float:
    """By how much neighbours differ where one shows something bright, as a sun. environment: (h, w, 3) float32"""
    return _RADIANCE_EDGE_FACTOR * float(luminance(environment).mean())


def is_radiance_edge(
    layer: TransparencyLayer, environment: F32, threshold: float, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Find pixels where the background, seen in mirrors, has the rim of something bright. (pixels,)

    Args:
        layer: of one ray through the middle of each pixel. environment: its radiance. (h, w, 3) float32
        threshold: from `radiance_edge_threshold`. size: width and height of the picture in pixels.
    """
    width, height = size
    value, rows = np.full(width * height, np.nan), np.flatnonzero(layer.hits.face < 0)
    value[layer.ray[rows]] = luminance(lookup(environment, layer.directions[rows]))
    edge = np.zeros((height, width), np.bool_)
    luminance_image = value.reshape(height, width)
    for first, second in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        # never where a neighbour sees something else
        is_different = np.abs(luminance_image[first] - luminance_image[second]) > threshold
        edge[first] |= is_different
        edge[second] |= is_different
    return edge.ravel()


def is_partial_coverage(geometry: SceneBuffers, origin: F32, directions: F32) -> NDArray[np.bool_]:
    """Find rays that meet a surface that blends. (n,)

    Args:
        geometry: the triangles. origin: of the rays. (3,) float32. directions: unit. (n, 3) float32
    """
    any_hit, opaque_hit = (
        trace_rays(geometry.embree, origin, directions, alpha_sample).face
        for alpha_sample in (STOP_AT_PARTIAL, STOP_AT_OPAQUE)
    )
    return np.asarray(any_hit != opaque_hit)
