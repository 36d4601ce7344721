"""Kernels of subtriangles: weighted, multiplied by averages of the fixed curves, distributed to bands of the free one.

Subtriangles are made in `relume.transport.project_kernel`, so that every angle is linear over each.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.core.simd import NUM as EIGHT
from relume.transport.band_overlap import add_means, deposit, mean_over_bands, overlap

_ONE_MINUS_EPSILON = np.float32(1 - 2**-24)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _overlaps(corner, num_bands, num, overlaps):  # type: ignore[no-untyped-def]
    """Compute `overlap` of subtriangles, angles clamped to the last band. corner: (3, n), overlaps: (5, n), written."""
    end = np.float32(num_bands) * _ONE_MINUS_EPSILON
    for n in range(num):
        low, middle, high, rise, fall = overlap(min(corner[0, n], end), min(corner[1, n], end), min(corner[2, n], end))
        overlaps[0, n], overlaps[1, n], overlaps[2, n] = low, middle, high
        overlaps[3, n], overlaps[4, n] = rise, fall


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _multiply_means(overlaps, bands, decrements, num_bands, num_rows, num, weight):  # type: ignore[no-untyped-def]
    """Multiply the weights (3, n) of subtriangles by the average of a fixed curve over each.

    Args:
        overlaps: from `_overlaps`.
        bands, decrements: bands and decrements of the curve, padded. (≥ num_rows, ≥ num_bands + 8) each
        num_rows: 1 if the channels are equal, else 3.
    """
    last = num_bands - 1
    for n in range(num):
        low, middle, high, rise, fall = overlaps[0, n], overlaps[1, n], overlaps[2, n], overlaps[3, n], overlaps[4, n]
        red = green = blue = np.float32(0)
        top = min(np.int64(low), last) - 1
        for band in range(top + 1, min(np.int64(high), last) + 1, EIGHT):
            red += mean_over_bands(decrements, 0, band, low, middle, high, rise, fall)
            if num_rows == 3:
                green += mean_over_bands(decrements, 1, band, low, middle, high, rise, fall)
                blue += mean_over_bands(decrements, 2, band, low, middle, high, rise, fall)
            top = band + EIGHT - 1
        red += bands[0, top]
        weight[0, n] *= red
        weight[1, n] *= green + bands[1, top] if num_rows == 3 else red
        weight[2, n] *= blue + bands[2, top] if num_rows == 3 else red


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _deposit(overlaps, num_bands, num, weight, out):  # type: ignore[no-untyped-def]
    """Distribute subtriangles to the bands of the free curve (eq. 22). weight: (3, n), out: (3, ≥ J + 8)."""
    last = num_bands - 1
    for n in range(num):
        first_band, last_band = min(np.int64(overlaps[0, n]), last), min(np.int64(overlaps[2, n]), last)
        for band in range(first_band, last_band + 1, EIGHT):
            deposit(
                out, band,
                overlaps[0, n], overlaps[1, n], overlaps[2, n], overlaps[3, n], overlaps[4, n],
                weight[0, n], weight[1, n], weight[2, n],
            )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _multiply_settings(overlaps, settings, num_bands, num, mean, product):  # type: ignore[no-untyped-def]
    """Multiply each subtriangle's product (n, rows) by its averages of a fixed curve at all settings.

    Args:
        overlaps: from `_overlaps`. settings: settings of the curve, padded. (≥ num_bands + 8, rows)
        mean: scratch. (rows,)
    """
    last = num_bands - 1
    for n in range(num):
        low, middle, high, rise, fall = overlaps[0, n], overlaps[1, n], overlaps[2, n], overlaps[3, n], overlaps[4, n]
        mean[:] = 0
        for band in range(min(np.int64(low), last), min(np.int64(high), last) + 1, EIGHT):
            for row in range(0, mean.shape[0], EIGHT):
                add_means(mean, settings, row, band, low, middle, high, rise, fall)
        for row in range(mean.shape[0]):
            product[n, row] *= mean[row]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_settings(subtriangles, num, num_bands, settings, setting_index, overlaps, weight, mean, product, out):  # type: ignore[no-untyped-def]
    """Add the subtriangles' weights (3, n) times their curves at all settings. out: (3, N)

    Processes few subtriangles at a time, so that their products stay in a core's first-level cache.
    """
    num_settings = out.shape[1]
    offset = num_settings if mean.shape[0] > num_settings else 0
    for begin in range(0, num, product.shape[0]):
        count = min(product.shape[0], num - begin)
        product[:count] = 1
        for k in range(subtriangles.shape[0]):
            if setting_index[k] >= 0:
                _overlaps(subtriangles[k, :, begin : begin + count], num_bands[k], count, overlaps)
                _multiply_settings(overlaps, settings[setting_index[k]], num_bands[k], count, mean, product)
        for n in range(count):
            for channel in range(3):
                channel_weight = weight[channel, begin + n]
                for row in range(num_settings):
                    out[channel, row] += channel_weight * product[n, offset * channel + row]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def weight_subtriangles(irradiance, light, shading, begin, entry_index, area_fractions, num, weight):  # type: ignore[no-untyped-def]
    """Weight the light of each subtriangle: irradiance · q cos θi · its fraction of the triangle.

    Args:
        irradiance: irradiance of all lights. (m, 3). light: light of each listed entry.
        shading: q cos θi of these. (1 or 3, entries)
        begin, entry_index: entry of each subtriangle, relative to `begin`.
        area_fractions: area fractions of the whole triangle.
        num: number of subtriangles. weight: written. (3, ≥ num)
    """
    blue_row = shading.shape[0] - 1
    for n in range(num):
        entry = np.uint64(begin + entry_index[n])
        m = np.uint64(light[entry])
        weight[0, n] = irradiance[m, 0] * (shading[0, entry] * area_fractions[n])
        weight[1, n] = irradiance[m, 1] * (shading[blue_row // 2, entry] * area_fractions[n])
        weight[2, n] = irradiance[m, 2] * (shading[blue_row, entry] * area_fractions[n])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def add_subtriangles(  # type: ignore[no-untyped-def]
    subtriangles, num, num_bands, bands, decrements, num_rows, settings, setting_index, active, overlaps, weight, mean,
    product, out
):  # fmt: skip
    """Weight the subtriangles by the fixed curves and add them to bands, settings or a sum.

    Args:
        subtriangles: angles at the corners, per curve. num: number of subtriangles.
        num_bands, bands, decrements, num_rows: sizes and arrays of the curves; see
            `_multiply_means`.
        settings, setting_index: see `_add_settings`. active: the free curve, −1 for none.
        overlaps, mean, product: scratch.
        weight: weight of the subtriangles, modified. (3, ≥ num). out: added to.
    """
    for k in range(subtriangles.shape[0]):
        if k != active and setting_index[k] < 0:
            _overlaps(subtriangles[k], num_bands[k], num, overlaps)
            _multiply_means(overlaps, bands[k], decrements[k], num_bands[k], num_rows[k], num, weight)
    if active >= 0:
        _overlaps(subtriangles[active], num_bands[active], num, overlaps)
        _deposit(overlaps, num_bands[active], num, weight, out)
    elif settings.shape[0] > 0:
        _add_settings(subtriangles, num, num_bands, settings, setting_index, overlaps, weight, mean, product, out)
    else:
        for channel in range(3):
            total = np.float32(0)
            for n in range(num):
                total += weight[channel, n]
            out[channel, 0] += total
