"""Kernels of `relume.transport.ray_projector`: rays are listed with their radiance, weighted, and binned.

A ray is a direction without extent: it falls into one band of every curve. Samples of area lights are listed as rays if
no curve depends on the light direction; otherwise see `relume.transport.area_light_kernel`.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.angles import compute_angles
from relume.core.numba_options import NO_REFCOUNT
from relume.lights.local_lights import light_sample
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.transport.gather_kernel import in_frame

F32 = NDArray[np.float32]


class RayScratch(NamedTuple):
    """Scratch memory of a point's rays.

    Attributes:
        gamma: an angle of each, bands. weight: light, times the fixed curves. band: of each curve.
        product: of curves at all settings, see `Contraction.settings`.
    """

    gamma: Shaped[F32, " rays"]
    weight: Shaped[F32, "3 rays"]
    band: Shaped[NDArray[np.int64], "C rays"]
    product: Shaped[F32, " columns"]


def allocate_scratch(num_curves: int, max_rays: int, num_columns: int) -> RayScratch:
    """Allocate scratch memory.

    Args:
        num_curves: number of curves. max_rays: maximum number of rays of a point.
        num_columns: number of columns of `Contraction.settings`.
    """
    gamma, weight = np.empty(max_rays, np.float32), np.empty((3, max_rays), np.float32)
    return RayScratch(gamma, weight, np.zeros((num_curves, max_rays), np.int64), np.empty(num_columns, np.float32))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def list_local_rays(points, wo, light, strata, gain, visible, start, stop, listed):  # type: ignore[no-untyped-def]
    """List the samples of a local light that are visible from points [start, stop).

    Args:
        points: `SurfacePoints`. wo: view directions. (n, 3) float32
        light, strata, gain, visible: as in `LocalRays`. start, stop: range of points.
        listed: `ListedRays`, written; the irradiance of a ray is w · cos θi · gain.
    Returns:
        K, the number of rays.
    """
    position, normal, tangent, seed, _ = points
    wi, end = listed.wi, 0
    for p in range(start, stop):
        listed.first[p - start] = end
        n, t = normal[p], tangent[p]
        (bx, by, bz), (ox, oy, oz) = in_frame(n, t, wo[p])
        shift_u, shift_v = cranley_patterson_offset(strata, seed[p])
        for sample in range(strata.uv.shape[0]):
            if not (visible[p, sample >> 3] >> (sample & 7)) & 1:
                continue
            dx, dy, dz, _, weight, _, _, _, _ = light_sample(
                light, strata, sample, shift_u, shift_v, position[p, 0], position[p, 1], position[p, 2]
            )
            z = n[0] * dx + n[1] * dy + n[2] * dz
            weight *= z
            if weight <= 0:
                continue
            wi[0, end], wi[1, end], wi[2, end] = t[0] * dx + t[1] * dy + t[2] * dz, bx * dx + by * dy + bz * dz, z
            listed.wo[0, end], listed.wo[1, end], listed.wo[2, end] = ox, oy, oz
            for channel in range(3):
                listed.irradiance[channel, end] = weight * gain[channel]
            end += 1
    listed.first[stop - start] = end
    return end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def list_mirror_lights(points, wo, direction, normal_irradiance, visible, start, stop, listed):  # type: ignore[no-untyped-def]
    """List the lights that points [start, stop) see in planar mirrors.

    Args:
        points, wo, start, stop: as in `list_local_rays`. direction, normal_irradiance, visible: as in `MirrorRays`.
        listed: written, as above; the irradiance of a ray is cos θi · `normal_irradiance`.
    Returns:
        K, the number of rays.
    """
    _, normal, tangent, _, _ = points
    wi, end = listed.wi, 0
    for p in range(start, stop):
        listed.first[p - start] = end
        n, t = normal[p], tangent[p]
        (bx, by, bz), (ox, oy, oz) = in_frame(n, t, wo[p])
        for k in range(direction.shape[0]):
            if not (visible[p, k >> 3] >> (k & 7)) & 1:
                continue
            dx, dy, dz = direction[k, 0], direction[k, 1], direction[k, 2]
            z = n[0] * dx + n[1] * dy + n[2] * dz
            if z <= 0:
                continue
            wi[0, end], wi[1, end], wi[2, end] = t[0] * dx + t[1] * dy + t[2] * dz, bx * dx + by * dy + bz * dz, z
            listed.wo[0, end], listed.wo[1, end], listed.wo[2, end] = ox, oy, oz
            for channel in range(3):
                listed.irradiance[channel, end] = z * normal_irradiance[k, channel]
            end += 1
    listed.first[stop - start] = end
    return end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _multiply(bands, num_rows, band, weight, num):  # type: ignore[no-untyped-def]
    """Multiply the weights of rays by a fixed curve. bands: (3, ≥ J). band: band of each ray. weight: (3, ≥ num)"""
    for channel in range(3):
        row = channel if num_rows == 3 else 0
        for n in range(num):
            weight[channel, n] *= bands[row, band[n]]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_settings(curves, scratch, num, out):  # type: ignore[no-untyped-def]
    """Add rays to all settings of the curves with several settings. out: (3, ≥ N)"""
    settings, setting_index, product, num_padded = curves.settings, curves.setting_index, scratch.product, out.shape[1]
    blue = settings.shape[2] // num_padded - 1
    for n in range(num):
        product[:] = 1
        for k in range(setting_index.shape[0]):
            if setting_index[k] >= 0:
                values = settings[setting_index[k], scratch.band[k, n]]
                for j in range(product.shape[0]):
                    product[j] *= values[j]
        for channel in range(3):
            begin, channel_out = (blue * channel // 2) * num_padded, out[channel]
            ray_weight = scratch.weight[channel, n]
            for j in range(num_padded):
                channel_out[j] += ray_weight * product[begin + j]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _contract(listed, begin, end, shading, curves, scratch):  # type: ignore[no-untyped-def]
    """Weight rays [begin, end) of a point by all curves except the free one and those with several settings."""
    num, blue_row = end - begin, shading.shape[0] - 1
    wi, wo, gamma, band, weight = listed.wi, listed.wo, scratch.gamma, scratch.band, scratch.weight
    for channel in range(3):
        irradiance, quotient, weighted = listed.irradiance[channel], shading[blue_row * channel // 2], weight[channel]
        for n in range(num):
            weighted[n] = irradiance[begin + n] * quotient[begin + n]
    for k in range(curves.kinds.shape[0]):
        axes = curves.axes[k]
        compute_angles(
            curves.kinds[k], curves.scale[k], wi[0, begin:end], wi[1, begin:end], wi[2, begin:end],
            axes[0] * wo[0, begin], axes[1] * wo[1, begin], axes[2] * wo[2, begin], gamma[:num],
        )  # fmt: skip
        for n in range(num):
            band[k, n] = min(np.int64(gamma[n]), curves.num_bands[k] - 1)
        if k != curves.active and curves.setting_index[k] < 0:
            _multiply(curves.bands[k], curves.num_rows[k], band[k], weight, num)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def weight_rays(listed, num_points, shading, curves, scratch, out):  # type: ignore[no-untyped-def]
    """Compute the contribution of each listed ray of the first points, with all curves contracted.

    Args:
        num_points: number of points. listed, shading, curves, scratch: as in `project_rays`.
        out: written. (3, K) float32
    """
    for p in range(num_points):
        begin, end = listed.first[p], listed.first[p + 1]
        if end > begin:
            _contract(listed, begin, end, shading, curves, scratch)
            for channel in range(3):
                for n in range(end - begin):
                    out[channel, begin + n] = scratch.weight[channel, n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def sum_rays(first, irradiance, shading, out):  # type: ignore[no-untyped-def]
    """Sum listed rays of a term without curves: only its quotient remains.

    Args:
        first, irradiance: of `ListedRays`. shading: as in `project_rays`. out: added to. (points, 3, ≥ 1) float32
    """
    blue_row = shading.shape[0] - 1
    for p in range(out.shape[0]):
        for n in range(first[p], first[p + 1]):
            for channel in range(3):
                out[p, channel, 0] += irradiance[channel, n] * shading[blue_row * channel // 2, n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def project_rays(listed, shading, curves, scratch, out):  # type: ignore[no-untyped-def]
    """Add listed rays to their points.

    Args:
        listed: `ListedRays`. shading: quotients, one row for all channels, or three. (1 or 3, K) float32
        curves: `Contraction`. scratch: from `allocate_scratch`.
        out: added to: bands of the free curve, or settings; padded. (points, 3, ≥ J or N) float32
    """
    for p in range(out.shape[0]):
        begin, end = listed.first[p], listed.first[p + 1]
        if begin == end:
            continue
        _contract(listed, begin, end, shading, curves, scratch)
        if curves.active >= 0:
            for n in range(end - begin):
                for channel in range(3):
                    out[p, channel, scratch.band[curves.active, n]] += scratch.weight[channel, n]
        elif curves.settings.shape[0] > 0:
            _add_settings(curves, scratch, end - begin, out[p])
        else:
            for channel in range(3):
                channel_weight, total = scratch.weight[channel], np.float32(0)
                for n in range(end - begin):
                    total += channel_weight[n]
                out[p, channel, 0] += total
