"""From rays to samples: of the rays of a pixel those that see the same thing become one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.trace.geometry import Geometry
from relume.trace.glass import Layer
from relume.trace.pixel_edges import COS_TURN, is_off_plane
from relume.trace.primary import Hits
from relume.trace.surface import surface_at

F32 = NDArray[np.float32]

# eight positions that no row or column shares (a rook pattern), pixel units
POSITIONS = (np.array([(0, 5), (1, 2), (2, 7), (3, 0), (4, 4), (5, 1), (6, 6), (7, 3)]) + 0.5) / 8
POSITIONS_A_PIXEL = len(POSITIONS)


class Chosen(NamedTuple):
    """Rays that samples are made of.

    Attributes:
        pixel: that each is of. (n,) int64. weight: share of it. (n,) float32
        hits, directions, through: see `relume.trace.glass.Layer`.
    """

    pixel: NDArray[np.int64]
    weight: F32
    hits: Hits
    directions: F32
    through: F32


def merged(geometry: Geometry, layer: Layer, pixels: NDArray[np.int64]) -> Chosen:
    """Group the rays of a layer by what they see, of the eight rays of each of some pixels.

    Of each group the ray next to its middle is kept, for as many eighths of the pixel as the group has rays.

    Args:
        geometry: the triangles. layer: of the rays, eight of a pixel in a row. pixels: whose they are. (p,)
    """
    shape = len(pixels), POSITIONS_A_PIXEL
    row = layer.ray[layer.is_shown]
    hits, directions = layer.hits.rows(layer.is_shown), layer.directions[layer.is_shown]
    mesh, normal = np.full(shape, -2), np.zeros((*shape, 3), np.float32)
    distance, rays, through = np.ones(shape, np.float32), np.ones((*shape, 3), np.float32), np.ones((*shape, 3))
    mesh.flat[row] = np.where(hits.face >= 0, geometry.face_mesh[np.maximum(hits.face, 0)], -1)
    distance.flat[row] = hits.distance
    for out, values in (
        (normal, surface_at(geometry, hits, directions).points.normal),
        (rays, directions),
        (through, layer.through[layer.is_shown]),
    ):
        out.reshape(-1, 3)[row] = values
    group = np.where(mesh == -2, -2, -1)
    for candidate in range(POSITIONS_A_PIXEL):
        # rays of the same mesh, turned alike and near the plane of the first that has no group yet
        one = slice(candidate, candidate + 1)
        cosine = np.einsum("pkc,pc->pk", normal, normal[:, candidate])
        off = is_off_plane(normal[:, one], distance[:, one], rays[:, one], distance, rays)
        same = (group == -1) & (mesh == mesh[:, one]) & (((cosine > COS_TURN) & ~off) | (mesh < 0))
        same &= (group[:, candidate] == -1)[:, None]
        group[same] = candidate
    pixel, first = np.nonzero(group == np.arange(POSITIONS_A_PIXEL))
    is_in = group[pixel] == first[:, None]
    size = is_in.sum(axis=1)
    kept = pixel * POSITIONS_A_PIXEL + _most_central(is_in, size)
    place = np.searchsorted(row, kept)
    mean = np.einsum("gk,gkc->gc", is_in, through[pixel]) / size[:, None]
    weight = (size / POSITIONS_A_PIXEL).astype(np.float32)
    return Chosen(pixels[pixel], weight, hits.rows(place), directions[place], mean.astype(np.float32))


def alone(layer: Layer, is_edge: NDArray[np.bool_]) -> Chosen:
    """The rays of a layer through the middles of pixels that are no edges. is_edge: of all pixels. (pixels,)"""
    rows = np.flatnonzero(layer.is_shown & ~is_edge[layer.ray])
    weight = np.ones(len(rows), np.float32)
    return Chosen(layer.ray[rows], weight, layer.hits.rows(rows), layer.directions[rows], layer.through[rows])


def joined(parts: Sequence[Chosen]) -> Chosen:
    """All of several."""
    pixel, weight, directions, through = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("pixel", "weight", "directions", "through")
    )
    return Chosen(pixel, weight, Hits.joined([part.hits for part in parts]), directions, through)


def _most_central(is_in: NDArray[np.bool_], size: NDArray[np.int64]) -> NDArray[np.int64]:
    """Choose of each group the position next to their mean: any other would shift what it shows to one side.

    Args:
        is_in: which positions are of a group. (groups, 8). size: how many those are. (groups,)
    """
    mean = is_in @ POSITIONS / size[:, None]
    away = np.sum((POSITIONS - mean[:, None]) ** 2, axis=-1)
    return np.asarray(np.where(is_in, away, np.inf).argmin(axis=1), np.int64)
