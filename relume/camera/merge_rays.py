"""Merge rays into samples: similar rays of a pixel become one sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.edge_detection import COS_NORMAL_EDGE, is_depth_edge
from relume.camera.transparency_layers import TransparencyLayer
from relume.raytrace.hit_normals import normals_at
from relume.raytrace.scene_buffers import SceneBuffers

F32 = NDArray[np.float32]

# rook patterns: no two positions share a row or column, pixel units; smaller ones if most pixels of an image are edges
PATTERNS = (
    (np.array([(0, 5), (1, 2), (2, 7), (3, 0), (4, 4), (5, 1), (6, 6), (7, 3)]) + 0.5) / 8,
    (np.array([(0, 1), (1, 3), (2, 0), (3, 2)]) + 0.5) / 4,
    (np.array([(0, 0), (1, 1)]) + 0.5) / 2,
)
POSITIONS_PER_PIXEL = len(PATTERNS[0])


class MergedRays(NamedTuple):
    """Rays that become samples.

    Attributes:
        pixel: pixel index of each ray. weight: fraction of the pixel.
        layer: hits of the rays.
    """

    pixel: Shaped[NDArray[np.int64], " n"]
    weight: Shaped[F32, " n"]
    layer: TransparencyLayer


def merge_rays(
    geometry: SceneBuffers,
    layer: TransparencyLayer,
    pixels: Shaped[NDArray[np.int64], " p"],
    positions: NDArray[np.float64] = PATTERNS[0],
) -> MergedRays:
    """Group similar rays of each pixel of a layer.

    The most central ray of each group is kept, weighted by the group's fraction of the pixel's rays.

    Args:
        geometry: the triangles. layer: layer of the rays, grouped by pixel. pixels: pixels of the rays.
        positions: positions of the rays in each pixel (n, 2); or of each pixel's, also on the lens (p, n, 4).
    """
    num = positions.shape[-2]
    positions = np.broadcast_to(positions, (len(pixels), *positions.shape[-2:]))
    shape, visible = (len(pixels), num), layer.visible
    row, is_direct = visible.ray, layer.chain is None
    key, normal, is_hit = np.full(shape, -2), np.zeros((*shape, 3), np.float32), np.zeros(shape, np.bool_)
    distance, ray_directions, transmittance = (
        np.ones(shape, np.float32),
        np.ones((*shape, 3), np.float32),
        np.ones((*shape, 3)),
    )
    key.flat[row], distance.flat[row], is_hit.flat[row] = visible.key, visible.hits.distance, visible.hits.face >= 0
    for out, values in (
        (normal, normals_at(geometry, visible.hits, visible.directions)),
        (ray_directions, visible.directions),
        (transmittance, visible.transmittance),
    ):
        out.reshape(-1, 3)[row] = values
    group = np.where(key == -2, -2, -1)
    for candidate in range(num):
        # rays on the same mesh with a similar normal, near the plane of the first ray without a group
        column = slice(candidate, candidate + 1)
        if is_direct:
            is_alike = ~is_depth_edge(
                normal[:, column], distance[:, column], ray_directions[:, column], distance, ray_directions
            )
        else:  # no common origin; each sees another region of the environment, perhaps the edge of a sun
            is_alike = np.einsum("pkc,pc->pk", ray_directions, ray_directions[:, candidate]) > COS_NORMAL_EDGE
            is_alike &= is_hit | (np.arange(num) == candidate)
        is_alike &= np.einsum("pkc,pc->pk", normal, normal[:, candidate]) > COS_NORMAL_EDGE
        is_same_group = (group == -1) & (key == key[:, column]) & (is_alike | (is_direct & ~is_hit))
        is_same_group &= (group[:, candidate] == -1)[:, None]
        group[is_same_group] = candidate
    pixel, first = np.nonzero(group == np.arange(num))
    is_member = group[pixel] == first[:, None]
    size = is_member.sum(axis=1)
    representative = pixel * num + _central_position(is_member, size, positions[pixel])
    mean = np.einsum("gk,gkc->gc", is_member, transmittance[pixel]) / size[:, None]
    group_layer = visible.rows(np.searchsorted(row, representative))._replace(transmittance=mean.astype(np.float32))
    return MergedRays(pixels[pixel], (size / num).astype(np.float32), group_layer)


def unmerged(layer: TransparencyLayer, pixels: Shaped[NDArray[np.int64], " p"]) -> MergedRays:
    """Visible rays of a layer with one ray through the center of each pixel. pixels: pixels of the rays"""
    visible = layer.visible
    return MergedRays(pixels[visible.ray], np.ones(len(visible.ray), np.float32), visible)


def concatenate_rays(ray_groups: Sequence[MergedRays], max_mirrors: int) -> MergedRays:
    """Concatenate groups of rays. max_mirrors: maximum number of mirrors on any ray"""
    pixel, weight, layers = zip(*ray_groups, strict=True)
    return MergedRays(np.concatenate(pixel), np.concatenate(weight), TransparencyLayer.concatenate(layers, max_mirrors))


def _central_position(
    is_member: NDArray[np.bool_], size: NDArray[np.int64], positions: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Choose the position closest to the mean of each group, so that samples are not biased to one side.

    Args:
        is_member: positions in each group. (groups, n). size: number of members. (groups,)
        positions: positions of all rays of the group's pixel. (groups, n, dimensions)
    """
    mean = np.einsum("gn,gnk->gk", is_member, positions) / size[:, None]
    squared_distance = np.sum((positions - mean[:, None]) ** 2, axis=-1)
    return np.asarray(np.where(is_member, squared_distance, np.inf).argmin(axis=1), np.int64)
