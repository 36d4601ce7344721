"""Outgoing radiance of BTF-textured surfaces, summed texel by texel.

    L(x, ωo) = Σ_v hat_v(ωo) Σ_j α_vj(x) Σ_l E_vkj(l) a_l(x),   a_l = Σ_s w_s hat_l(ω_s)

a is the incident light at a point (`relume.transport.texture_light`). For a BTF with a height map, x is shifted per
view v so that all views show the same point of the relief (`relume.assets.btf.parallax`).
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import interpolation_weights
from relume.assets.btf.parallax import compute_shear, compute_shears, parallax_intersection
from relume.brdf.terms.btf import BtfRef
from relume.core.numba_options import NO_REFCOUNT
from relume.lights.spherical_triangles import TriangleLights
from relume.math.fast_math import fast_log2
from relume.transport.shading_points import ShadingPoints
from relume.transport.texture_light import texture_axes, texture_light_rows, to_texture_frame

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MIN_COSINE = np.float32(1e-3)
_TEXEL = np.float32(0.5)  # texel side per footprint side: bilinear interpolation doubles the width
_MAX_FOOTPRINT_SAMPLES = 4  # along a footprint
_MAX_SPACING = np.float32(1.5)  # texels between footprint samples
_MAX_ELONGATION = np.float32(3)  # footprint length over width: longer ones sum coarser texels


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def linear_taps(coordinate, count):  # type: ignore[no-untyped-def]
    """Return the two texels of a row around a coordinate in [0, 1], and the fraction of the second."""
    x = coordinate * np.float32(count) - np.float32(0.5)
    # floor without a call, for any coordinate
    low = min(max(np.int32(x + np.float32(1)) - 1, np.int32(-1)), np.int32(count - 1))
    fraction = np.float32(x - np.float32(low))
    return (low if low >= 0 else count - 1), (low + 1 if low + 1 < count else 0), fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def neighbor_texels(levels, u, v, footprint, texel, weight):  # type: ignore[no-untyped-def]
    """Select texels for trilinear interpolation.

    Args:
        levels: levels of the BTF. u, v: coordinates, in repeats. footprint: its side, in repeats.
        texel: indices, written. (8,) int32. weight: weight of each texel, written. (8,) float32
    Returns:
        Number of texels: four of each level with a weight.
    """
    level = mip_level(footprint, np.float32(max(levels[0, 1], levels[0, 2])))
    u, v = np.float32(u - math.floor(u)), np.float32(v - math.floor(v))  # the integer modulo is slow
    return texels_at_level(levels, u, v, level, texel, weight)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def mip_level(footprint, finest):  # type: ignore[no-untyped-def]
    """Return the fractional mip level of a footprint, not clamped. finest: side of level 0, in texels."""
    return fast_log2(max(_TEXEL * footprint * finest, np.float32(1)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def texels_at_level(levels, u, v, level, texel, weight):  # type: ignore[no-untyped-def]
    """Select texels for trilinear interpolation at a given level, as `neighbor_texels`.

    Args:
        levels, texel, weight: as in `neighbor_texels`. u, v: in [0, 1). level: fractional, see `mip_level`.
    """
    coarsest = levels.shape[0] - 1
    clamped_level = min(level, np.float32(coarsest))
    lower = np.int64(clamped_level)
    level_fraction = np.float32(clamped_level - np.float32(lower))
    num = 0
    for step in range(2):
        level_weight = level_fraction if step == 1 else np.float32(1) - level_fraction
        if level_weight <= 0 or lower + step > coarsest:
            continue
        first, height, width = levels[lower + step, 0], levels[lower + step, 1], levels[lower + step, 2]
        left, right, fx = linear_taps(u, width)
        upper, below, fy = linear_taps(v, height)
        upper, below = first + upper * width, first + below * width
        texel[num], texel[num + 1], texel[num + 2], texel[num + 3] = (
            upper + left,
            upper + right,
            below + left,
            below + right,
        )
        top, bottom = level_weight * (np.float32(1) - fy), level_weight * fy
        weight[num], weight[num + 1] = top * (np.float32(1) - fx), top * fx
        weight[num + 2], weight[num + 3] = bottom * (np.float32(1) - fx), bottom * fx
        num += 4
    return num


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def anisotropic_offsets(footprint, up, finest):  # type: ignore[no-untyped-def]
    """Distribute samples along an anisotropic footprint.

    Box and tent filter of texels of side t have a variance of t²/4, and n samples at distance d have d² (n² − 1) / 12:
    together they equal a²/12, the variance of the footprint's length a.

    Args:
        footprint: side of the square of equal area, in repeats. up: cosine of the slant. finest: see `mip_level`.
    Returns:
        Number of samples; their distance; the width of the footprint that selects the level.
    """
    slanted = np.float32(math.sqrt(max(up, _MIN_COSINE)))
    length: Any = footprint / slanted
    width: Any = max(footprint * slanted, length / _MAX_ELONGATION)
    texel: Any = max(_TEXEL * width, np.float32(1) / finest)
    beyond: Any = length * length - np.float32(3) * texel * texel
    if beyond <= 0:
        return 1, np.float32(0), width
    num: Any = min(max(np.int64(math.ceil(length / (_MAX_SPACING * texel))), 2), _MAX_FOOTPRINT_SAMPLES)
    return num, np.float32(math.sqrt(beyond / np.float32(num * num - 1))), width


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _add_weights(cluster, weight, view, texel, texel_weight, num, sample_weight, num_clusters, clusters, sums):  # type: ignore[no-untyped-def]
    """Add the weights of texels for one view, by cluster.

    Args:
        cluster, weight: arrays of the BTF. view: its index.
        texel, texel_weight: see `neighbor_texels`. num: number of texels.
        sample_weight: weight of this footprint sample.
        num_clusters: clusters so far. clusters: their indices, written. (≥ num_clusters + num,) int32
        sums: weights of their means and components, written. (≥ num_clusters + num, ≥ 1 + C)
    Returns:
        The new number of clusters.
    """
    for k in range(num):
        texel_index, w = texel[k], sample_weight * texel_weight[k]
        cluster_index = cluster[view, texel_index]
        slot = 0
        while slot < num_clusters and clusters[slot] != cluster_index:
            slot += 1
        if slot == num_clusters:
            clusters[slot] = cluster_index
            for j in range(sums.shape[1]):
                sums[slot, j] = 0
            num_clusters += 1
        sums[slot, 0] += w
        for j in range(min(weight.shape[2], sums.shape[1] - 1)):
            sums[slot, 1 + j] += w * np.float32(weight[view, texel_index, j])
    return num_clusters


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _footprint_samples(levels, heights, footprint_center, x, y, z, slant, out):  # type: ignore[no-untyped-def]
    """Distribute samples along a footprint and look up the relief height of each.

    Args:
        levels: levels of the BTF. heights, footprint_center: as in `_shade_texels`. x, y, z: view direction.
        slant: its slant.
        out: u, v and height of each sample, written. (≥ samples, 3)
    Returns:
        Number of samples; width of the footprint.
    """
    num, spacing, width = anisotropic_offsets(footprint_center[2], z, np.float32(max(levels[0, 1], levels[0, 2])))
    across = np.float32(1) / max(np.float32(math.sqrt(x * x + y * y)), _MIN_COSINE)
    for k in range(num):
        offset = spacing * across * (np.float32(k) - np.float32(0.5) * np.float32(num - 1))
        out[k, 0], out[k, 1] = footprint_center[0] + offset * x, footprint_center[1] - offset * y
        out[k, 2] = parallax_intersection(heights[0], heights[1], heights[2], out[k, 0], out[k, 1], slant)
    return num, width


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _shade_texels(grid, tables, texel_arrays, heights, incident, axes, wo, positions, out):  # type: ignore[no-untyped-def]
    """Compute the outgoing radiance of n points.

    Args:
        heights: height map, its minimum and maximum, slants of the views.
        incident: (n, 3, L). wo: in shading frames. (n, 3). positions: u and v in repeats, side of the footprint. (n, 3)
        out: written. (n, 3)
    """
    levels, cluster, weight = texel_arrays
    sides = heights[3]
    index, view_weight = np.empty(4, np.int32), np.empty(4, np.float32)
    texel, texel_weight = np.empty(8, np.int32), np.empty(8, np.float32)
    max_clusters = 8 * _MAX_FOOTPRINT_SAMPLES
    clusters, sums = np.empty(max_clusters, np.int32), np.empty((max_clusters, tables.shape[2]), np.float32)
    samples = np.empty((_MAX_FOOTPRINT_SAMPLES, 3), np.float32)
    for p in range(incident.shape[0]):
        out[p, :] = 0
        if wo[p, 2] <= 0:
            continue
        vx, vy = to_texture_frame(wo[p, 0], wo[p, 1], axes[p])
        interpolation_weights(grid, vx, vy, wo[p, 2], index, view_weight)
        slant = compute_shear(grid, vx, vy, wo[p, 2])
        num_samples, width = _footprint_samples(levels, heights, positions[p], vx, vy, wo[p, 2], slant, samples)
        sample_weight = np.float32(1) / np.float32(num_samples)
        for tap in range(4):
            if view_weight[tap] <= 0:
                continue
            side, num_clusters = sides[index[tap]], 0
            for k in range(num_samples):
                u, v, h = samples[k, 0], samples[k, 1], samples[k, 2]
                across, up = h * (slant[0] - side[0]), h * (slant[1] - side[1])
                num = neighbor_texels(levels, u + across, v - up, width, texel, texel_weight)
                num_clusters = _add_weights(
                    cluster, weight, index[tap], texel, texel_weight, num, sample_weight, num_clusters, clusters, sums
                )
            for slot in range(num_clusters):
                cluster_table = tables[index[tap], clusters[slot]]
                for j in range(tables.shape[2]):
                    factor = view_weight[tap] * sums[slot, j]
                    for channel in range(3):
                        total = np.float32(0)
                        for light in range(tables.shape[4]):
                            total += cluster_table[j, channel, light] * incident[p, channel, light]
                        out[p, channel] += factor * total
        for channel in range(3):
            out[p, channel] = max(out[p, channel], np.float32(0))


def _texture_positions(btf_ref: BtfRef, uv: F32) -> F32:
    """Return u, v and footprint side in repeats, (n, 3), for `_shade_texels`."""
    cosine, sine, u, up = math.cos(btf_ref.rotation), math.sin(btf_ref.rotation), uv[:, 0], -uv[:, 1]
    # v of the BTF points up, v of the coordinates down
    positions = btf_ref.scale * np.stack([cosine * u + sine * up, sine * u - cosine * up, uv[:, 2]], axis=1)
    return positions.astype(np.float32)


def texel_rows(
    btf_ref: BtfRef, lights: TriangleLights | None, receivers: ShadingPoints, start: int, stop: int
) -> Shaped[F32, "m 3"]:
    """Compute the outgoing radiance of points [start, stop), texel by texel.

    Args:
        btf_ref: the BTF and its mapping. lights: lights of the environment, None for rays alone.
        receivers: all points, with `uv`. start, stop: range of points.
    Returns:
        Outgoing radiance.
    """
    return outgoing_rows(
        btf_ref, btf_ref.tables, texture_light_rows(btf_ref, lights, receivers, start, stop), receivers, start
    )


def outgoing_rows(
    btf_ref: BtfRef, tables: Shaped[F32, " ..."], incident: Shaped[F32, "m 3 L"], receivers: ShadingPoints, start: int
) -> Shaped[F32, "m 3"]:
    """Compute the outgoing radiance of points from binned incident light.

    Args:
        btf_ref: the BTF and its mapping. tables: tables of the BTF, or from `rotated_tables`.
        incident: incident light of m points, see `texture_light_rows`.
        receivers: all points, with `uv`. start: the first of the m points.
    Returns:
        Outgoing radiance.
    """
    assert receivers.uv is not None
    rows, btf = slice(start, start + len(incident)), btf_ref.btf
    uv, axes = receivers.uv[rows], texture_axes(btf_ref.rotation, receivers.uv[rows])
    n, t, wo = (np.ascontiguousarray(a[rows], np.float32) for a in (receivers.normal, receivers.tangent, receivers.wo))
    local = np.stack([(t * wo).sum(axis=1), (np.cross(n, t) * wo).sum(axis=1), (n * wo).sum(axis=1)], axis=1)
    out = np.empty((len(incident), 3), np.float32)
    texel_arrays = btf.levels, btf.cluster, btf.weight
    heights = btf.height, btf.height.min(), btf.height.max(), compute_shears(btf.grid)
    args = (
        btf.grid,
        tables,
        texel_arrays,
        heights,
        incident,
        axes,
        np.ascontiguousarray(local),
        _texture_positions(btf_ref, uv),
        out,
    )
    _shade_texels(*args)
    return out
