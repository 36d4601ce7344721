"""Pixels of a view that want more rays than one: what is seen changes across them, or is partly there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.environments.equirect import lookup
from relume.eye.layers import Layer
from relume.trace.cutout_filter import ANYWHERE, EVERYWHERE
from relume.trace.geometry import Geometry
from relume.trace.normals import normals_at
from relume.trace.primary import trace_from

F32 = NDArray[np.float32]

COS_TURN = np.cos(np.radians(4.0))  # one sample would show a sharp reflection from one side only
_COS_EDGE = np.cos(np.radians(20.0))  # a crease
_DEPTH_EDGE = 0.02  # of the distance, off the plane of the surface beside
NOT_IN = -2  # the key of pixels whose ray a layer has not
_BRIGHT = 1.0  # of the mean radiance around; darker details of a map are left to its own filter
_MOST_TURNING = 1 / 6  # of all pixels; where more turn, as on coarse bumps, those that turn most


def _edges(key: NDArray[np.int64], normal: F32, distance: F32, directions: F32) -> tuple[NDArray[np.bool_], F32]:
    """Find pixels that differ from a neighbour, and the least cosine between the normals of each and its neighbours.

    Args:
        key: what is hit, `NOT_IN` where a layer has no ray. normal, distance: of the hits. directions: of the rays.
            All are (height, width, …).
    Returns:
        (height, width) both
    """
    edge, cosine = np.zeros(key.shape, np.bool_), np.ones(key.shape, np.float32)
    for axis in (0, 1):
        here = tuple(slice(None, -1) if a == axis else slice(None) for a in (0, 1))
        there = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
        between = np.einsum("ijk,ijk->ij", normal[here], normal[there])
        off = [
            is_off_plane(normal[one], distance[one], directions[one], distance[other], directions[other])
            for one, other in ((here, there), (there, here))
        ]
        # off both planes: of one alone may be a surface that is seen along itself
        is_seen = (key[here] != NOT_IN) & (key[there] != NOT_IN)
        differs = (key[here] != key[there]) | (is_seen & ((between < _COS_EDGE) | (off[0] & off[1])))
        for side in (here, there):
            edge[side] |= differs
            cosine[side] = np.minimum(cosine[side], between)
    return edge, cosine


def is_off_plane(normal: F32, distance: F32, direction: F32, other_distance: F32, other: F32) -> NDArray[np.bool_]:
    """Tell whether what another ray of an eye hits is off the plane of a hit by more than a small share of the way.

    Args:
        normal, distance, direction: of a hit, and of its ray. (…, 3), (…), (…, 3)
        other_distance, other: of the other hit, and of its ray. (…), (…, 3)
    """
    with np.errstate(invalid="ignore", divide="ignore"):  # background is infinitely far
        slope = np.vecdot(direction, normal) / np.vecdot(other, normal)
        nearer = np.minimum(distance, other_distance)
        return np.asarray(np.abs(other_distance - distance * slope) > _DEPTH_EDGE * nearer)


def is_turning(cosine: F32) -> NDArray[np.bool_]:
    """Find pixels that are no edges, but whose normals turn enough for reflections to alias. (pixels,)

    Args:
        cosine: of all pixels of a picture, from `edges_of`. (pixels,)
    """
    turning = cosine < COS_TURN
    most = int(_MOST_TURNING * cosine.size)
    if np.count_nonzero(turning) > most:
        turning &= cosine < np.partition(cosine[turning], most)[most]
    return np.asarray(turning)


def edges_of(geometry: Geometry, layer: Layer, size: tuple[int, int]) -> tuple[NDArray[np.bool_], F32]:
    """Find pixels that want more rays by what a layer shows.

    Args:
        geometry: the triangles. layer: of one ray through the middle of each pixel. size: width and height in pixels.
    Returns:
        (pixels,) both: whether it is an edge; else the least cosine between its normal and its neighbours', 1 where
        there is nothing that turns.
    """
    width, height = size
    normals = normals_at(geometry, layer.hits, layer.directions)
    key, normal = np.full(width * height, NOT_IN), np.zeros((width * height, 3), np.float32)
    distance, directions = np.full(width * height, np.inf, np.float32), np.ones((width * height, 3), np.float32)
    key[layer.ray] = layer.key
    normal[layer.ray] = normals
    if layer.chain is None:  # a mirror's rays have no eye in common: no steps in depth are told in it
        distance[layer.ray] = layer.hits.distance
    directions[layer.ray] = layer.directions
    shape = (height, width)
    seen = key.reshape(shape)
    differs, cosine = _edges(seen, normal.reshape(*shape, 3), distance.reshape(shape), directions.reshape(*shape, 3))
    cosine[differs | (seen < 0)] = 1
    return differs.ravel(), cosine.ravel()


def brightness_of(environment: F32) -> float:
    """By how much neighbours differ where one shows something bright, as a sun. environment: (h, w, 3) float32"""
    return _BRIGHT * float(luminance(environment).mean())


def bright_edges_of(layer: Layer, environment: F32, bright: float, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Find pixels where the background, seen in mirrors, has the rim of something bright. (pixels,)

    Args:
        layer: of one ray through the middle of each pixel. environment: its radiance. (h, w, 3) float32
        bright: from `brightness_of`. size: width and height of the picture in pixels.
    """
    width, height = size
    value, rows = np.full(width * height, np.nan), np.flatnonzero(layer.hits.face < 0)
    value[layer.ray[rows]] = luminance(lookup(environment, layer.directions[rows]))
    edge = np.zeros((height, width), np.bool_)
    seen = value.reshape(height, width)
    for here, there in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        differs = np.abs(seen[here] - seen[there]) > bright  # never where a neighbour sees something else
        edge[here] |= differs
        edge[there] |= differs
    return edge.ravel()


def is_partly_there(geometry: Geometry, origin: F32, directions: F32) -> NDArray[np.bool_]:
    """Find rays that meet a surface that blends. (n,)

    Args:
        geometry: the triangles. origin: of the rays. (3,) float32. directions: unit. (n, 3) float32
    """
    at_least, wholly = (
        trace_from(geometry.embree, origin, directions, chance).face for chance in (ANYWHERE, EVERYWHERE)
    )
    return np.asarray(at_least != wholly)
