"""From rays to samples: of the rays of a pixel those that see the same thing become one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.eye.layers import Layer
from relume.eye.pixel_edges import COS_TURN, is_off_plane
from relume.trace.geometry import Geometry
from relume.trace.normals import normals_at

F32 = NDArray[np.float32]

# positions that no row or column shares (rook patterns), pixel units; fewer where most pixels of a picture are edges
PATTERNS = (
    (np.array([(0, 5), (1, 2), (2, 7), (3, 0), (4, 4), (5, 1), (6, 6), (7, 3)]) + 0.5) / 8,
    (np.array([(0, 1), (1, 3), (2, 0), (3, 2)]) + 0.5) / 4,
    (np.array([(0, 0), (1, 1)]) + 0.5) / 2,
)
POSITIONS_A_PIXEL = len(PATTERNS[0])


class Chosen(NamedTuple):
    """Rays that samples are made of.

    Attributes:
        pixel: that each is of. (n,) int64. weight: share of it. (n,) float32
        seen: what each meets.
    """

    pixel: NDArray[np.int64]
    weight: F32
    seen: Layer


def merged(
    geometry: Geometry, layer: Layer, pixels: NDArray[np.int64], positions: NDArray[np.float64] = PATTERNS[0]
) -> Chosen:
    """Group the rays of a layer by what they see, of the rays of each of some pixels.

    Of each group the ray next to its middle is kept, for the share of the pixel that the group has of its rays.

    Args:
        geometry: the triangles. layer: of the rays, those of a pixel in a row. pixels: whose they are. (p,)
        positions: of the rays in each pixel. (n, 2)
    """
    num = len(positions)
    shape, seen = (len(pixels), num), layer.shown
    row, is_direct = seen.ray, layer.chain is None
    key, normal, is_hit = np.full(shape, -2), np.zeros((*shape, 3), np.float32), np.zeros(shape, np.bool_)
    distance, rays, through = np.ones(shape, np.float32), np.ones((*shape, 3), np.float32), np.ones((*shape, 3))
    key.flat[row], distance.flat[row], is_hit.flat[row] = seen.key, seen.hits.distance, seen.hits.face >= 0
    for out, values in (
        (normal, normals_at(geometry, seen.hits, seen.directions)),
        (rays, seen.directions),
        (through, seen.through),
    ):
        out.reshape(-1, 3)[row] = values
    group = np.where(key == -2, -2, -1)
    for candidate in range(num):
        # rays of the same mesh, turned alike and near the plane of the first that has no group yet
        one = slice(candidate, candidate + 1)
        if is_direct:
            is_alike = ~is_off_plane(normal[:, one], distance[:, one], rays[:, one], distance, rays)
        else:  # no eye in common; of the background each sees a part of its own, the rim of a sun perhaps
            is_alike = np.einsum("pkc,pc->pk", rays, rays[:, candidate]) > COS_TURN
            is_alike &= is_hit | (np.arange(num) == candidate)
        is_alike &= np.einsum("pkc,pc->pk", normal, normal[:, candidate]) > COS_TURN
        same = (group == -1) & (key == key[:, one]) & (is_alike | (is_direct & ~is_hit))
        same &= (group[:, candidate] == -1)[:, None]
        group[same] = candidate
    pixel, first = np.nonzero(group == np.arange(num))
    is_in = group[pixel] == first[:, None]
    size = is_in.sum(axis=1)
    kept = pixel * num + _most_central(is_in, size, positions)
    mean = np.einsum("gk,gkc->gc", is_in, through[pixel]) / size[:, None]
    of_group = seen.rows(np.searchsorted(row, kept))._replace(through=mean.astype(np.float32))
    return Chosen(pixels[pixel], (size / num).astype(np.float32), of_group)


def alone(layer: Layer, pixels: NDArray[np.int64]) -> Chosen:
    """The rays of a layer through the middles of pixels that are no edges. pixels: of all rays. (p,)"""
    seen = layer.shown
    return Chosen(pixels[seen.ray], np.ones(len(seen.ray), np.float32), seen)


def joined(parts: Sequence[Chosen], most_mirrors: int) -> Chosen:
    """All of several. most_mirrors: that any ray has met."""
    pixel, weight, seen = zip(*parts, strict=True)
    return Chosen(np.concatenate(pixel), np.concatenate(weight), Layer.joined(seen, most_mirrors))


def _most_central(
    is_in: NDArray[np.bool_], size: NDArray[np.int64], positions: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Choose of each group the position next to their mean: any other would shift what it shows to one side.

    Args:
        is_in: which positions are of a group. (groups, n). size: how many those are. (groups,)
        positions: of all. (n, 2)
    """
    mean = is_in @ positions / size[:, None]
    away = np.sum((positions - mean[:, None]) ** 2, axis=-1)
    return np.asarray(np.where(is_in, away, np.inf).argmin(axis=1), np.int64)
