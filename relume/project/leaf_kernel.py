"""The kernels of leaves: weighed, multiplied by the means of dormant curves, shared out to the bands of the free one.

Leaves are made in `relume.project.project_kernel`, where every angle is linear over each.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.project.eight_bands import add_means_of_eight, deposit_eight, mean_of_eight, overlap_of
from relume.uncounted import UNCOUNTED
from relume.vector_code import NUM as EIGHT

_BELOW_ONE = np.float32(1 - 2**-24)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _overlaps(corner, num_bands, num, overlap):  # type: ignore[no-untyped-def]
    """Find `overlap_of` leaves, angles held below the last band's end. corner: (3, n), overlap: (5, n), written."""
    end = np.float32(num_bands) * _BELOW_ONE
    for n in range(num):
        low, middle, high, rise, fall = overlap_of(
            min(corner[0, n], end), min(corner[1, n], end), min(corner[2, n], end)
        )
        overlap[0, n], overlap[1, n], overlap[2, n] = low, middle, high
        overlap[3, n], overlap[4, n] = rise, fall


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _multiply_means(overlap, bands, falls, num_bands, num_rows, num, weight):  # type: ignore[no-untyped-def]
    """Multiply the weights (3, n) of leaves by the mean of a dormant curve over each.

    Args:
        overlap: from `_overlaps`. bands, falls: of the curve, padded. (≥ num_rows, ≥ num_bands + 8) each
        num_rows: 1 where the channels are alike, else 3.
    """
    last = num_bands - 1
    for n in range(num):
        low, middle, high, rise, fall = overlap[0, n], overlap[1, n], overlap[2, n], overlap[3, n], overlap[4, n]
        red = green = blue = np.float32(0)
        top = min(np.int64(low), last) - 1
        for band in range(top + 1, min(np.int64(high), last) + 1, EIGHT):
            red += mean_of_eight(falls, 0, band, low, middle, high, rise, fall)
            if num_rows == 3:
                green += mean_of_eight(falls, 1, band, low, middle, high, rise, fall)
                blue += mean_of_eight(falls, 2, band, low, middle, high, rise, fall)
            top = band + EIGHT - 1
        red += bands[0, top]
        weight[0, n] *= red
        weight[1, n] *= green + bands[1, top] if num_rows == 3 else red
        weight[2, n] *= blue + bands[2, top] if num_rows == 3 else red


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _deposit(overlap, num_bands, num, weight, out):  # type: ignore[no-untyped-def]
    """Share leaves out to the bands of the free curve (eq. 22). weight: (3, n), out: (3, ≥ J + 8)."""
    last = num_bands - 1
    for n in range(num):
        first_band, last_band = min(np.int64(overlap[0, n]), last), min(np.int64(overlap[2, n]), last)
        for band in range(first_band, last_band + 1, EIGHT):
            deposit_eight(
                out, band,
                overlap[0, n], overlap[1, n], overlap[2, n], overlap[3, n], overlap[4, n],
                weight[0, n], weight[1, n], weight[2, n],
            )  # fmt: skip


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _multiply_settings(overlap, settings, num_bands, num, mean, product):  # type: ignore[no-untyped-def]
    """Multiply each leaf's product (n, rows) by the means of a dormant curve at all its settings over that leaf.

    Args:
        overlap: from `_overlaps`. settings: of the curve, padded. (≥ num_bands + 8, rows)
        mean: scratch. (rows,)
    """
    last = num_bands - 1
    for n in range(num):
        low, middle, high, rise, fall = overlap[0, n], overlap[1, n], overlap[2, n], overlap[3, n], overlap[4, n]
        mean[:] = 0
        for band in range(min(np.int64(low), last), min(np.int64(high), last) + 1, EIGHT):
            for row in range(0, mean.shape[0], EIGHT):
                add_means_of_eight(mean, settings, row, band, low, middle, high, rise, fall)
        for row in range(mean.shape[0]):
            product[n, row] *= mean[row]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _add_settings(leaves, num, num_bands, settings, setting_of, overlap, weight, mean, product, out):  # type: ignore[no-untyped-def]
    """Add the leaves' weights (3, n) times their curves at all settings. out: (3, N)

    A handful of leaves at a time, whose products stay in a core's first-level cache.
    """
    num_settings = out.shape[1]
    offset = num_settings if mean.shape[0] > num_settings else 0
    for begin in range(0, num, product.shape[0]):
        count = min(product.shape[0], num - begin)
        product[:count] = 1
        for k in range(leaves.shape[0]):
            if setting_of[k] >= 0:
                _overlaps(leaves[k, :, begin : begin + count], num_bands[k], count, overlap)
                _multiply_settings(overlap, settings[setting_of[k]], num_bands[k], count, mean, product)
        for n in range(count):
            for channel in range(3):
                of_channel = weight[channel, begin + n]
                for row in range(num_settings):
                    out[channel, row] += of_channel * product[n, offset * channel + row]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def weigh_leaves(irradiance, light, shading, begin, of_entry, shares, num, weight):  # type: ignore[no-untyped-def]
    """Weigh the light of each leaf: irradiance · q cos θi · its share of the triangle.

    Args:
        irradiance: of all lights. (m, 3). light: of each listed pair. shading: q cos θi of these. (1 or 3, pairs)
        begin, of_entry: pair of each leaf, from `begin` on. shares: of the leaves in its triangle.
        num: of leaves. weight: written. (3, ≥ num)
    """
    blue_row = shading.shape[0] - 1
    for n in range(num):
        entry = np.uint64(begin + of_entry[n])
        m = np.uint64(light[entry])
        weight[0, n] = irradiance[m, 0] * (shading[0, entry] * shares[n])
        weight[1, n] = irradiance[m, 1] * (shading[blue_row // 2, entry] * shares[n])
        weight[2, n] = irradiance[m, 2] * (shading[blue_row, entry] * shares[n])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def spend(  # type: ignore[no-untyped-def]
    leaves, num, num_bands, bands, falls, num_rows, settings, setting_of, active, overlap, weight, mean, product, out
):  # fmt: skip
    """Weigh the leaves by the dormant curves and share them out.

    Args:
        leaves: where each lies along each curve. num: of them.
        num_bands, bands, falls, num_rows: of the curves; see `_multiply_means`.
        settings, setting_of: see `_add_settings`. active: curve that stays, −1 for none.
        overlap, mean, product: room for what leaves share with bands, and what it comes to.
        weight: of the leaves, changed. (3, ≥ num). out: added to.
    """
    for k in range(leaves.shape[0]):
        if k != active and setting_of[k] < 0:
            _overlaps(leaves[k], num_bands[k], num, overlap)
            _multiply_means(overlap, bands[k], falls[k], num_bands[k], num_rows[k], num, weight)
    if active >= 0:
        _overlaps(leaves[active], num_bands[active], num, overlap)
        _deposit(overlap, num_bands[active], num, weight, out)
    elif settings.shape[0] > 0:
        _add_settings(leaves, num, num_bands, settings, setting_of, overlap, weight, mean, product, out)
    else:
        for channel in range(3):
            total = np.float32(0)
            for n in range(num):
                total += weight[channel, n]
            out[channel, 0] += total
