"""Kernels of `relume.transport.ray_projector`: rays are listed with their radiance, weighted, and binned.

A ray is a direction without extent: it falls into one band of every curve. Samples of area lights are listed as rays if
no curve depends on the light direction; otherwise see `relume.transport.area_light_kernel`.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.brdf.angles import compute_angles
from relume.core.numba_options import NO_REFCOUNT
from relume.lights.local_lights import light_sample
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.transport.gather_kernel import in_frame

_NONE = np.int64(-1)  # no curve is free


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def list_local_rays(  # type: ignore[no-untyped-def]
    points, wo, light, strata, gain, visible, start, stop, first, wi, out, irradiance
):
    """List the samples of a local light that are visible from points [start, stop).

    Args:
        points: `SurfacePoints`. wo: view directions. (n, 3) float32
        light, strata, gain, visible: as in `LocalRays`. start, stop: range of points.
        first, wi, out, irradiance: written, as by `relume.transport.gather_kernel.list_gather_rays`; the irradiance of
            a ray is w · cos θi · gain.
    Returns:
        K, the number of rays.
    """
    position, normal, tangent, seed, _ = points
    end = 0
    for p in range(start, stop):
        first[p - start] = end
        n, t = normal[p], tangent[p]
        (bx, by, bz), (ox, oy, oz) = in_frame(n, t, wo[p])
        shift_u, shift_v = cranley_patterson_offset(strata, seed[p])
        for sample in range(strata.uv.shape[0]):
            if not (visible[p, sample >> 3] >> (sample & 7)) & 1:
                continue
            dx, dy, dz, _, weight, _, _, _ = light_sample(
                light, strata, sample, shift_u, shift_v, position[p, 0], position[p, 1], position[p, 2]
            )
            z = n[0] * dx + n[1] * dy + n[2] * dz
            weight *= z
            if weight <= 0:
                continue
            wi[0, end], wi[1, end], wi[2, end] = t[0] * dx + t[1] * dy + t[2] * dz, bx * dx + by * dy + bz * dz, z
            out[0, end], out[1, end], out[2, end] = ox, oy, oz
            for channel in range(3):
                irradiance[channel, end] = weight * gain[channel]
            end += 1
    first[stop - start] = end
    return end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def list_mirror_lights(  # type: ignore[no-untyped-def]
    points, wo, direction, normal_irradiance, visible, start, stop, first, wi, out, irradiance
):
    """List the lights that points [start, stop) see in planar mirrors.

    Args:
        points, wo, start, stop: as in `list_local_rays`. direction, normal_irradiance, visible: as in `MirrorRays`.
        first, wi, out, irradiance: written, as above; the irradiance of a ray is cos θi · `normal_irradiance`.
    Returns:
        K, the number of rays.
    """
    _, normal, tangent, _, _ = points
    end = 0
    for p in range(start, stop):
        first[p - start] = end
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
            out[0, end], out[1, end], out[2, end] = ox, oy, oz
            for channel in range(3):
                irradiance[channel, end] = z * normal_irradiance[k, channel]
            end += 1
    first[stop - start] = end
    return end


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _multiply(bands, num_rows, band, weight, num):  # type: ignore[no-untyped-def]
    """Multiply the weights of rays by a fixed curve. bands: (3, ≥ J). band: band of each ray. weight: (3, ≥ num)"""
    for channel in range(3):
        row = channel if num_rows == 3 else 0
        for n in range(num):
            weight[channel, n] *= bands[row, band[n]]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_settings(settings, setting_index, band, weight, num, product, out):  # type: ignore[no-untyped-def]
    """Add rays to all settings of the curves with several settings.

    Args:
        band: band of each curve and ray. product: scratch, as long as a row of the settings. out: (3, ≥ N)
    """
    num_padded = out.shape[1]
    blue = settings.shape[2] // num_padded - 1
    for n in range(num):
        product[:] = 1
        for k in range(setting_index.shape[0]):
            if setting_index[k] >= 0:
                values = settings[setting_index[k], band[k, n]]
                for j in range(product.shape[0]):
                    product[j] *= values[j]
        for channel in range(3):
            begin, channel_out, ray_weight = (blue * channel // 2) * num_padded, out[channel], weight[channel, n]
            for j in range(num_padded):
                channel_out[j] += ray_weight * product[begin + j]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _contract(  # type: ignore[no-untyped-def]
    begin, end, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, setting_index, active,
    gamma, band, weight,
):  # fmt: skip
    """Weight rays [begin, end) of a point by all curves except the free one and those with several settings.

    Writes band (curves, ≥ rays) and weight (3, ≥ rays).
    """
    num, blue_row = end - begin, shading.shape[0] - 1
    for channel in range(3):
        channel_irradiance, quotient, weighted = irradiance[channel], shading[blue_row * channel // 2], weight[channel]
        for n in range(num):
            weighted[n] = channel_irradiance[begin + n] * quotient[begin + n]
    for k in range(kinds.shape[0]):
        scale = np.float32(num_bands[k] / (math.pi / 2))
        compute_angles(
            kinds[k], scale, wi[0, begin:end], wi[1, begin:end], wi[2, begin:end],
            axes[k, 0] * wo[0, begin], axes[k, 1] * wo[1, begin], axes[k, 2] * wo[2, begin], gamma[:num],
        )  # fmt: skip
        for n in range(num):
            band[k, n] = min(np.int64(gamma[n]), num_bands[k] - 1)
        if k != active and setting_index[k] < 0:
            _multiply(bands[k], num_rows[k], band[k], weight, num)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def weight_rays(first, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, setting_index, out):  # type: ignore[no-untyped-def]
    """Compute the contribution of each listed ray, with all curves contracted.

    Args:
        first, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, setting_index: as in
        `project_rays`.
        out: written. (3, K) float32
    """
    max_rays = np.diff(first).max()
    gamma, weight = np.empty(max_rays, np.float32), np.empty((3, max_rays), np.float32)
    band = np.empty((kinds.shape[0], max_rays), np.int64)
    for p in range(first.shape[0] - 1):
        begin, end = first[p], first[p + 1]
        if end > begin:
            _contract(
                begin, end, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, setting_index, _NONE,
                gamma, band, weight,
            )  # fmt: skip
            for channel in range(3):
                out[channel, begin:end] = weight[channel, : end - begin]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def sum_rays(first, irradiance, shading, out):  # type: ignore[no-untyped-def]
    """Sum listed rays of a term without curves: only its quotient remains.

    Args:
        first, irradiance, shading: as in `project_rays`. out: added to. (points, 3, ≥ 1) float32
    """
    blue_row = shading.shape[0] - 1
    for p in range(out.shape[0]):
        for n in range(first[p], first[p + 1]):
            for channel in range(3):
                out[p, channel, 0] += irradiance[channel, n] * shading[blue_row * channel // 2, n]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def project_rays(  # type: ignore[no-untyped-def]
    first, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, settings, setting_index, active, out
):
    """Add listed rays to their points.

    Args:
        first, wi, wo, irradiance: from `list_gather_rays` or `list_local_rays`; wo is their `out`.
        shading: quotients, one row for all channels, or three. (1 or 3, K) float32
        kinds, axes, num_bands, bands, num_rows, settings, setting_index, active: see `Contraction`.
        out: added to: bands of the free curve, or settings; padded. (points, 3, ≥ J or N) float32
    """
    max_rays = np.diff(first[: out.shape[0] + 1]).max()
    gamma, weight = np.empty(max_rays, np.float32), np.empty((3, max_rays), np.float32)
    band, product = np.zeros((kinds.shape[0], max_rays), np.int64), np.empty(settings.shape[2], np.float32)
    _project(
        first, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, settings, setting_index, active,
        (gamma, weight, band, product), out,
    )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _project(  # type: ignore[no-untyped-def]
    first, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, settings, setting_index, active,
    scratch, out,
):  # fmt: skip
    """Implement `project_rays`. scratch: gamma, weight, band of `_contract`, product of `_add_settings`."""
    gamma, weight, band, product = scratch
    for p in range(out.shape[0]):
        begin, end = first[p], first[p + 1]
        num = end - begin
        if num == 0:
            continue
        _contract(
            begin, end, wi, wo, irradiance, shading, kinds, axes, num_bands, bands, num_rows, setting_index, active,
            gamma, band, weight,
        )  # fmt: skip
        if active >= 0:
            for n in range(num):
                for channel in range(3):
                    out[p, channel, band[active, n]] += weight[channel, n]
        elif settings.shape[0] > 0:
            _add_settings(settings, setting_index, band, weight, num, product, out[p])
        else:
            for channel in range(3):
                channel_weight, total = weight[channel], np.float32(0)
                for n in range(num):
                    total += channel_weight[n]
                out[p, channel, 0] += total
