"""Outgoing radiance of points with a BTF, used by the reference; tested against plain NumPy."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import interpolation_weights
from relume.assets.btf.local_pca_btf import F32, LocalPcaBtf
from relume.assets.btf.parallax import compute_shear, compute_shears, parallax_intersection
from relume.core.numba_options import NO_REFCOUNT

F64 = NDArray[np.float64]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _add_texels(size, u, v, position_weight, cluster, weight, cluster_slot, used_clusters, factors):  # type: ignore[no-untyped-def]
    """Add the four texels around a position to the factors of their clusters' means and components.

    Args:
        size: height and width. u, v: the position, in texels from the center of the first. position_weight: its weight.
        cluster, weight: cluster indices and weights of the texels.
        cluster_slot: row of `factors` for each cluster, negative if it has none yet.
        used_clusters: clusters with a row; the last entry is their number.
    """
    left, upper = math.floor(u), math.floor(v)
    for corner in range(4):
        right, down = corner & 1, corner >> 1
        corner_weight = position_weight * abs(1 - right - (u - left)) * abs(1 - down - (v - upper))
        texel = (np.int64(upper) + down) % size[0] * size[1] + (np.int64(left) + right) % size[1]
        k = cluster[texel]
        if cluster_slot[k] < 0:
            cluster_slot[k] = used_clusters[-1]
            used_clusters[used_clusters[-1]] = k
            factors[used_clusters[-1]] = 0
            used_clusters[-1] += 1
        row = factors[cluster_slot[k]]
        row[0] += corner_weight
        for j in range(weight.shape[1]):
            row[1 + j] += corner_weight * weight[texel, j]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sample_btf_kernel(grid, shears, height, size, cluster, weight, tables, texel_positions, wo, out):  # type: ignore[no-untyped-def]
    """Kernel of `sample_btf`. shears: parallax shear of each grid direction. size: height and width, texels."""
    lowest, highest = height.min(), height.max()
    view, view_weight = np.empty(4, np.int32), np.empty(4, np.float32)
    cluster_slot, used_clusters = np.full(256, -1, np.int64), np.empty(4 * texel_positions.shape[1] + 1, np.int64)
    factors, total = np.empty((len(used_clusters), tables.shape[2]), np.float32), np.empty(tables.shape[3:], np.float32)
    heights, width = np.empty(texel_positions.shape[1], np.float32), np.float32(size[1])
    rows = np.float32(size[0])
    for p in range(len(texel_positions)):
        total[:] = 0
        interpolation_weights(grid, wo[p, 0], wo[p, 1], wo[p, 2], view, view_weight)
        shear = compute_shear(grid, wo[p, 0], wo[p, 1], wo[p, 2])
        for k in range(len(heights)):
            u, v = (texel_positions[p, k, 0] + 0.5) / size[1], (texel_positions[p, k, 1] + 0.5) / size[0]
            heights[k] = parallax_intersection(
                height, lowest, highest, np.float32(u - math.floor(u)), np.float32(v - math.floor(v)), shear
            )
        for tap in range(4):
            if view_weight[tap] == 0:
                continue
            view_index, used_clusters[-1] = view[tap], 0
            sx, sy = shear[0] - shears[view_index, 0], shear[1] - shears[view_index, 1]
            for k in range(len(heights)):
                u, v = (
                    texel_positions[p, k, 0] + heights[k] * sx * width,
                    texel_positions[p, k, 1] - heights[k] * sy * rows,
                )
                _add_texels(
                    size,
                    u,
                    v,
                    view_weight[tap] / len(heights),
                    cluster[view_index],
                    weight[view_index],
                    cluster_slot,
                    used_clusters,
                    factors,
                )
            for row in range(used_clusters[-1]):
                table = tables[view_index, used_clusters[row]]
                cluster_slot[used_clusters[row]] = -1
                for j in range(table.shape[0]):
                    factor = factors[row, j]
                    for channel in range(3):
                        for light in range(table.shape[2]):
                            total[channel, light] += factor * table[j, channel, light]
        for light in range(total.shape[1]):
            for channel in range(3):
                out[p, light, channel] = total[channel, light]


def sample_btf(
    btf: LocalPcaBtf, tables: F32, texel_positions: Shaped[F64, "n texels 2"], wo: Shaped[F64, "n 3"]
) -> Shaped[F32, "n L 3"]:
    """Reflected radiance toward `wo` for each measured light direction, averaged over the texels of each point.

    Args:
        btf: the BTF. tables: from `LocalPcaBtf.tables`.
        texel_positions: column and row, in texels of the finest level, from the center of the first.
        wo: view directions in the frame of the texture, above the horizon, unit.
    Returns:
        Radiance per unit of irradiance perpendicular to the light direction, including the cosine.
    """
    out = np.empty((len(wo), btf.grid.num_directions, 3), np.float32)
    _sample_btf_kernel(
        btf.grid, compute_shears(btf.grid), btf.height, btf.size, btf.cluster, btf.weight, tables, texel_positions,
        wo.astype(np.float32), out,
    )  # fmt: skip
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _outgoing_radiance_kernel(grid, values_by_light, axes, point_index, wi, out):  # type: ignore[no-untyped-def]
    """Kernel of `outgoing_radiance`."""
    index, weight = np.empty(4, np.int32), np.empty(4, np.float32)
    for m in range(len(wi)):
        p, x, y, z = point_index[m], np.float32(wi[m, 0]), np.float32(wi[m, 1]), np.float32(wi[m, 2])
        tx, ty = axes[p, 0, 0] * x + axes[p, 0, 1] * y, axes[p, 1, 0] * x + axes[p, 1, 1] * y
        cosine_ratio = interpolation_weights(grid, np.float32(tx), np.float32(ty), z, index, weight)
        for channel in range(3):
            total = np.float32(0)
            for k in range(4):
                total += weight[k] * values_by_light[p, index[k], channel]
            out[m, channel] = cosine_ratio * total


def outgoing_radiance(
    btf: LocalPcaBtf,
    values_by_light: Shaped[F32, "points L 3"],
    axes: Shaped[F64, "points 2 2"],
    point_index: Shaped[NDArray[np.int64], " n"],
    wi: Shaped[F64, "n 3"],
) -> Shaped[F64, "n 3"]:
    """Reflected radiance for any light direction, interpolated between the measured ones.

    Args:
        btf: the BTF. values_by_light: from `sample_btf`.
        axes: axes of the texture, in the frames of the points.
        point_index: point of each direction. wi: unit directions in the frames of their points.
    Returns:
        Radiance per unit of irradiance perpendicular to `wi`, including the cosine.
    """
    out = np.empty((len(wi), 3))
    _outgoing_radiance_kernel(btf.grid, values_by_light, axes, point_index, np.ascontiguousarray(wi, np.float64), out)
    return out
