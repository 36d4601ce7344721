"""Merged light triangles, for operators that are computed quickly.

Tiles are the leaves of a hierarchy; tiles under an inner node that a coarser division would not split are merged. The
visible fraction of a merged triangle is the fraction of its light from visible parts
(docs/direct-light.md#algorithm).
"""

from __future__ import annotations

from dataclasses import replace

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.core.numba_options import NO_REFCOUNT
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import MergedParts, TriangleLights, merge_clusters
from relume.lights.tile_hierarchy import highest_ancestors, sum_inner_nodes
from relume.lights.tile_subdivision import SOLID_ANGLE_EXPONENT, UNIFORM_FRACTION

F64 = NDArray[np.float64]
Codes = NDArray[np.uint64]

_LIGHTS_PER_CLUSTER, _MIN_CLUSTERS = 8, 400


def num_clusters(num_lights: int) -> int:
    """Return the number of merged lights of a merged-light operator. num_lights: number of lights of the bake."""
    return max(_MIN_CLUSTERS, num_lights // _LIGHTS_PER_CLUSTER)


def cluster_lights(lights: TriangleLights, tiles: Tiles, num_clusters: int) -> TriangleLights:
    """Merge the light of tiles into about `num_clusters` triangles, with their parts.

    Args:
        lights: lights of the tiles. tiles: M tiles. num_clusters: number of merged triangles, at most M;
            rounded down to the form 8 + 3k.
    """
    luminous = luminance(lights.irradiance).astype(np.float64)
    codes, group = np.unique(_coarser_codes(tiles, luminous, num_clusters), return_inverse=True)
    clusters = merge_clusters(lights, group, codes)
    cluster_light = np.bincount(group, luminous, len(codes))
    fraction = np.divide(luminous, cluster_light[group], out=np.zeros_like(luminous), where=luminous > 0)
    return replace(clusters, parts=MergedParts(group.astype(np.int32), fraction.astype(np.float32)))


def _coarser_codes(tiles: Tiles, luminous: F64, num_clusters: int) -> Codes:
    """Return the tile of each tile in a division into about `num_clusters`. (M,)

    A node's metric is never below that of its children, so the nodes with the largest metrics are split.
    """
    uniform = UNIFORM_FRACTION * float(luminous.sum()) / (4 * np.pi)
    inner, (light, extent) = sum_inner_nodes(tiles.codes, np.stack([luminous, tiles.solid_angles]))
    metric = light * extent**SOLID_ANGLE_EXPONENT + uniform * extent  # as in `choose_tiles`
    num_split = min(len(inner), max(0, num_clusters - 8) // 3)
    return highest_ancestors(tiles.codes, inner[np.argsort(-metric, kind="stable")[:num_split]])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def visible_fraction(visible, group, fraction, start, stop, visible_fractions):  # type: ignore[no-untyped-def]
    """Sum the fraction of each merged triangle's light from parts that are visible from points [start, stop).

    Args:
        visible: part m of a point in bit m & 7 of byte m >> 3. (n, bytes) uint8
        group, fraction: see `MergedParts`. visible_fractions: written, points last, since these are vectorized.
            (C, ≥ stop - start) float32
    """
    num_points = stop - start
    bits = np.empty(num_points, np.uint8)
    visible_fractions[:, :num_points] = 0
    for byte in range(visible.shape[1]):
        any_bit = np.uint8(0)
        for p in range(num_points):
            bits[p] = visible[start + p, byte]
            any_bit |= bits[p]
        if any_bit == 0:  # adjacent points are often all occluded
            continue
        for m in range(8 * byte, min(8 * byte + 8, group.shape[0])):
            cluster, part_fraction, shift = np.uint64(group[m]), fraction[m], np.uint8(m & 7)
            for p in range(num_points):
                visible_fractions[cluster, p] += np.float32((bits[p] >> shift) & np.uint8(1)) * part_fraction


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def weight_by_visibility(first, light, visible_fractions, shading):  # type: ignore[no-untyped-def]
    """Multiply the shading of listed merged lights by their visible fractions.

    Args:
        first, light: from `relume.transport.light_culling.list_lights`. visible_fractions: from `visible_fraction`.
            (C, ≥ points)
        shading: shading of each entry, multiplied. (1 or 3, K) float32
    """
    for p in range(first.shape[0] - 1):
        for row in range(shading.shape[0]):
            for entry in range(first[p], first[p + 1]):
                shading[row, entry] *= visible_fractions[light[entry], p]
