"""From rays to samples: of the rays of a pixel those that see the same thing become one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.camera.edge_detection import COS_NORMAL_EDGE, is_depth_edge
from relume.camera.transparency_layers import TransparencyLayer
from relume.raytrace.hit_normals import normals_at
from relume.raytrace.scene_buffers import SceneBuffers

F32 = NDArray[np.float32]

# positions that no row or column shares (rook patterns), pixel units; fewer where most pixels of a picture are edges
PATTERNS = (
    (np.array([(0, 5), (1, 2), (2, 7), (3, 0), (4, 4), (5, 1), (6, 6), (7, 3)]) + 0.5) / 8,
    (np.array([(0, 1), (1, 3), (2, 0), (3, 2)]) + 0.5) / 4,
    (np.array([(0, 0), (1, 1)]) + 0.5) / 2,
)
POSITIONS_PER_PIXEL = len(PATTERNS[0])


class MergedRays(NamedTuple):
    """Rays that samples are made of.

    Attributes:
        pixel: that each is of. (n,) int64. weight: share of it. (n,) float32
        layer: what each meets.
    """

    pixel: NDArray[np.int64]
    weight: F32
    layer: TransparencyLayer


def merge_rays(
    geometry: SceneBuffers,
    layer: TransparencyLayer,
    pixels: NDArray[np.int64],
    positions: NDArray[np.float64] = PATTERNS[0],
) -> MergedRays:
    """Group the rays of a layer by what they see, of the rays of each of some pixels.

    Of each group the ray next to its middle is kept, for the share of the pixel that the group has of its rays.

    Args:
        geometry: the triangles. layer: of the rays, those of a pixel in a row. pixels: whose they are. (p,)
        positions: of the rays in each pixel. (n, 2)
    """
    num = len(positions)
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
        # rays of the same mesh, turned alike and near the plane of the first that has no group yet
        column = slice(candidate, candidate + 1)
        if is_direct:
            is_alike = ~is_depth_edge(
                normal[:, column], distance[:, column], ray_directions[:, column], distance, ray_directions
            )
        else:  # no eye in common; of the background each sees a part of its own, the rim of a sun perhaps
            is_alike = np.einsum("pkc,pc->pk", ray_directions, ray_directions[:, candidate]) > COS_NORMAL_EDGE
            is_alike &= is_hit | (np.arange(num) == candidate)
        is_alike &= np.einsum("pkc,pc->pk", normal, normal[:, candidate]) > COS_NORMAL_EDGE
        is_same_group = (group == -1) & (key == key[:, column]) & (is_alike | (is_direct & ~is_hit))
        is_same_group &= (group[:, candidate] == -1)[:, None]
        group[is_same_group] = candidate
    pixel, first = np.nonzero(group == np.arange(num))
    is_member = group[pixel] == first[:, None]
    size = is_member.sum(axis=1)
    representative = pixel * num + _central_position(is_member, size, positions)
    mean = np.einsum("gk,gkc->gc", is_member, transmittance[pixel]) / size[:, None]
    group_layer = visible.rows(np.searchsorted(row, representative))._replace(transmittance=mean.astype(np.float32))
    return MergedRays(pixels[pixel], (size / num).astype(np.float32), group_layer)


def unmerged(layer: TransparencyLayer, pixels: NDArray[np.int64]) -> MergedRays:
    """The rays of a layer through the middles of pixels that are no edges. pixels: of all rays. (p,)"""
    visible = layer.visible
    return MergedRays(pixels[visible.ray], np.ones(len(visible.ray), np.float32), visible)


def concatenate_rays(ray_groups: Sequence[MergedRays], max_mirrors: int) -> MergedRays:
    """All of several. most_mirrors: that any ray has met."""
    pixel, weight, layers = zip(*ray_groups, strict=True)
    return MergedRays(np.concatenate(pixel), np.concatenate(weight), TransparencyLayer.concatenate(layers, max_mirrors))


def _central_position(
    is_member: NDArray[np.bool_], size: NDArray[np.int64], positions: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Choose of each group the position next to their mean: any other would shift what it shows to one side.

    Args:
        is_member: which positions are of a group. (groups, n). size: how many those are. (groups,)
        positions: of all. (n, 2)
    """
    mean = is_member @ positions / size[:, None]
    squared_distance = np.sum((positions - mean[:, None]) ** 2, axis=-1)
    return np.asarray(np.where(is_member, squared_distance, np.inf).argmin(axis=1), np.int64)
