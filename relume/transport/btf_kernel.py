"""What surfaces send whose every texel has a BRDF of its own: the sum over light, texel by texel.

    L(x, ωo) = Σ_v hat_v(ωo) Σ_j α_vj(x) Σ_l E_vkj(l) a_l(x),   a_l = Σ_s w_s hat_l(ω_s)

where a is all light that arrives at a place (`relume.transport.texture_light`). Where relief is known, x is from each
side v where the same of it is seen (`relume.assets.btf.parallax`).
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import interpolation_weights
from relume.assets.btf.parallax import compute_shear, compute_shears, parallax_intersection
from relume.brdf.terms.btf import BtfRef
from relume.core.numba_options import UNCOUNTED
from relume.lights.spherical_triangles import TriangleLights
from relume.math.fast_math import fast_log2
from relume.transport.shading_points import ShadingPoints
from relume.transport.texture_light import texture_axes, texture_light_rows, to_texture_frame

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MIN_COSINE = np.float32(1e-3)
_TEXEL = np.float32(0.5)  # side of the texels for a footprint, in footprints: a mean between four is twice as wide
_MAX_FOOTPRINT_SAMPLES = 4  # along a footprint
_MAX_SPACING = np.float32(1.5)  # texels, between them at most
_MAX_ELONGATION = np.float32(3)  # footprint, in widths: of longer ones coarser texels are summed


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _linear_taps(coordinate, count):  # type: ignore[no-untyped-def]
    """Find the two texels of a row beside a place within [0, 1], and the share of the second."""
    x: Any = coordinate * np.float32(count) - np.float32(0.5)
    # a floor, which would be a call; whatever the place is
    low: Any = min(max(np.int32(x + np.float32(1)) - 1, np.int32(-1)), np.int32(count - 1))
    fraction = np.float32(x - np.float32(low))
    return (low if low >= 0 else count - 1), (low + 1 if low + 1 < count else 0), fraction


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def neighbor_texels(levels, u, v, footprint, texel, weight):  # type: ignore[no-untyped-def]
    """Find the texels about a place, of the two levels about a footprint.

    Args:
        levels: of the BTF. u, v: the place, in repeats. footprint: side of it, in repeats.
        texel: their numbers, written. (8,) int32. weight: of each, written. (8,) float32
    Returns:
        How many there are: four of each level that has a share.
    """
    level = mip_level(footprint, np.float32(max(levels[0, 1], levels[0, 2])))
    u, v = np.float32(u - math.floor(u)), np.float32(v - math.floor(v))  # remainders of integers are slow
    return texels_at_level(levels, u, v, level, texel, weight)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def mip_level(footprint, finest):  # type: ignore[no-untyped-def]
    """Level of halvings for a footprint, however many there are. finest: side of the finest, in texels."""
    return fast_log2(max(_TEXEL * footprint * finest, np.float32(1)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def texels_at_level(levels, u, v, level, texel, weight):  # type: ignore[no-untyped-def]
    """Do as `neighbor_texels`.

    Args:
        levels, texel, weight: as there. u, v: shares of a repeat. level: between two, see `mip_level`.
    """
    coarsest = levels.shape[0] - 1
    clamped_level: Any = min(level, np.float32(coarsest))
    lower = np.int64(clamped_level)
    level_fraction = np.float32(clamped_level - np.float32(lower))
    num = 0
    for step in range(2):
        level_weight = level_fraction if step == 1 else np.float32(1) - level_fraction
        if level_weight <= 0 or lower + step > coarsest:
            continue
        first, height, width = levels[lower + step, 0], levels[lower + step, 1], levels[lower + step, 2]
        left, right, fx = _linear_taps(u, width)
        upper, below, fy = _linear_taps(v, height)
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def anisotropic_offsets(footprint, up, finest):  # type: ignore[no-untyped-def]
    """Find places whose texels, summed, are as long as a footprint, which a slant makes longer than wide.

    Box and tent of texels of side t have a variance of t²/4 about a place, n places d apart one of d² (n² − 1) / 12:
    both together are that of the footprint's length, a²/12.

    Args:
        footprint: side of the square of its area, in repeats. up: cosine of the slant. finest: see `mip_level`.
    Returns:
        How many places; how far apart; the footprint's width, or what stands for it.
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _add_weights(cluster, weight, view, texel, texel_weight, num, sample_weight, num_clusters, clusters, sums):  # type: ignore[no-untyped-def]
    """Add the weights of texels, seen from one side, by their clusters.

    Args:
        cluster, weight: of the BTF. view: the side. texel, texel_weight: see `neighbor_texels`. num: of them.
        sample_weight: that they are of all texels.
        num_clusters: clusters that there are yet. clusters: these, written. (≥ num_found + num,) int32
        sums: of their means' and components' weights, written. (≥ num_found + num, ≥ 1 + C)
    Returns:
        How many clusters there are.
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **UNCOUNTED)
def _footprint_samples(levels, heights, footprint_center, x, y, z, slant, out):  # type: ignore[no-untyped-def]
    """Find the places that stand for a footprint, and how high the relief is that is seen there.

    Args:
        levels: of the BTF. heights, footprint_center: as of `_send`. x, y, z: the direction to the eye. slant: s of it.
        out: u, v and height of each, written. (≥ places, 3)
    Returns:
        How many; the width of the footprint.
    """
    num, spacing, width = anisotropic_offsets(footprint_center[2], z, np.float32(max(levels[0, 1], levels[0, 2])))
    across: Any = np.float32(1) / max(np.float32(math.sqrt(x * x + y * y)), _MIN_COSINE)
    for k in range(num):
        offset = spacing * across * (np.float32(k) - np.float32(0.5) * np.float32(num - 1))
        out[k, 0], out[k, 1] = footprint_center[0] + offset * x, footprint_center[1] - offset * y
        out[k, 2] = parallax_intersection(heights[0], heights[1], heights[2], out[k, 0], out[k, 1], slant)
    return num, width


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _shade_texels(grid, tables, texel_arrays, heights, incident, axes, wo, positions, out):  # type: ignore[no-untyped-def]
    """Sum what n points send.

    Args:
        heights: heights, the lowest and the highest of them, slants of the sides.
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
    """Where points are on the texture. (n, 3), as `_send` wants them"""
    cosine, sine, u, up = math.cos(btf_ref.rotation), math.sin(btf_ref.rotation), uv[:, 0], -uv[:, 1]
    # up in the texture is down in its coordinates
    positions = btf_ref.scale * np.stack([cosine * u + sine * up, sine * u - cosine * up, uv[:, 2]], axis=1)
    return positions.astype(np.float32)


def texel_rows(btf_ref: BtfRef, lights: TriangleLights | None, receivers: ShadingPoints, start: int, stop: int) -> F32:
    """Find what points send, texel by texel.

    Args:
        btf_ref: how they are covered. lights: of the environment, None for rays alone.
        receivers: all points; `uv` says where they are.
        start, stop: those that are asked about.
    Returns:
        Radiance. (stop - start, 3) float32
    """
    return outgoing_rows(
        btf_ref, btf_ref.tables, texture_light_rows(btf_ref, lights, receivers, start, stop), receivers, start
    )


def outgoing_rows(btf_ref: BtfRef, tables: F32, incident: F32, receivers: ShadingPoints, start: int) -> F32:
    """Find what points send of light that has been shared out.

    Args:
        btf_ref: how they are covered. tables: of the BTF, or those that `rotated_tables` made of them.
        incident: at the points that are asked about, see `texture_light_rows`. (n, 3, L)
        receivers: all points; `uv` says where they are. start: the first that is asked about.
    Returns:
        Radiance. (n, 3) float32
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
