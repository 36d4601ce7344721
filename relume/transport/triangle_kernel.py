"""Kernels of subtriangles: weighted, multiplied by averages of the fixed curves, distributed to bands of the free one.

Subtriangles are made in `relume.transport.project_kernel`, so that every angle is linear over each.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.simd import NUM as EIGHT
from relume.transport.band_overlap import add_means, deposit, mean_over_bands, overlap

F32 = NDArray[np.float32]

_ONE_MINUS_EPSILON = np.float32(1 - 2**-24)
_SUBTRIANGLES_PER_BATCH = 64  # multiplied by the settings of a curve


class Subtriangles(NamedTuple):
    """Memory for the subtriangles of a point, n at most.

    Attributes:
        corners: angles at the corners, bands. area_fraction: of the whole triangle. entry: of each, relative to the
            point's first in `ListedLights`.
        overlaps: from `_overlaps`. weight: light per channel, multiplied by averages of the fixed curves.
        mean, product: averages of a curve at all settings, and products of curves for a few subtriangles.
    """

    corners: Shaped[F32, "C 3 n"]
    area_fraction: Shaped[F32, " n"]
    entry: Shaped[NDArray[np.int64], " n"]
    overlaps: Shaped[F32, "5 n"]
    weight: Shaped[F32, "3 n"]
    mean: Shaped[F32, " rows"]
    product: Shaped[F32, "batch rows"]


def allocate_subtriangles(num_curves: int, capacity: int, num_rows: int) -> Subtriangles:
    """Allocate memory for subtriangles. num_rows: of `Contraction.settings`."""
    corners, area_fraction = np.empty((num_curves, 3, capacity), np.float32), np.empty(capacity, np.float32)
    overlaps, weight = np.empty((5, capacity), np.float32), np.empty((3, capacity), np.float32)
    mean, product = np.empty(num_rows, np.float32), np.empty((_SUBTRIANGLES_PER_BATCH, num_rows), np.float32)
    return Subtriangles(corners, area_fraction, np.empty(capacity, np.int64), overlaps, weight, mean, product)


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
def _add_settings(subtriangles, num, curves, out):  # type: ignore[no-untyped-def]
    """Add the subtriangles' weights times their curves at all settings. out: (3, N)

    Processes few subtriangles at a time, so that their products stay in a core's first-level cache.
    """
    mean, product, overlaps = subtriangles.mean, subtriangles.product, subtriangles.overlaps
    num_bands, num_settings = curves.num_bands, out.shape[1]
    offset = num_settings if mean.shape[0] > num_settings else 0
    for begin in range(0, num, product.shape[0]):
        count = min(product.shape[0], num - begin)
        product[:count] = 1
        for k in range(curves.setting_index.shape[0]):
            if curves.setting_index[k] >= 0:
                _overlaps(subtriangles.corners[k, :, begin : begin + count], num_bands[k], count, overlaps)
                settings = curves.settings[curves.setting_index[k]]
                _multiply_settings(overlaps, settings, num_bands[k], count, mean, product)
        for n in range(count):
            for channel in range(3):
                channel_weight = subtriangles.weight[channel, begin + n]
                for row in range(num_settings):
                    out[channel, row] += channel_weight * product[n, offset * channel + row]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _weight(subtriangles, num, listed, shading, begin, irradiance):  # type: ignore[no-untyped-def]
    """Weight the light of each subtriangle: irradiance · q cos θi · its fraction of the triangle."""
    blue_row, weight = shading.shape[0] - 1, subtriangles.weight
    for n in range(num):
        entry = np.uint64(begin + subtriangles.entry[n])
        m, area_fraction = np.uint64(listed.light[entry]), subtriangles.area_fraction[n]
        weight[0, n] = irradiance[m, 0] * (shading[0, entry] * area_fraction)
        weight[1, n] = irradiance[m, 1] * (shading[blue_row // 2, entry] * area_fraction)
        weight[2, n] = irradiance[m, 2] * (shading[blue_row, entry] * area_fraction)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def add_subtriangles(subtriangles, num, listed, shading, begin, irradiance, curves, out):  # type: ignore[no-untyped-def]
    """Weight the subtriangles by their light and the fixed curves and add them to bands, settings or a sum.

    Args:
        subtriangles: `Subtriangles`; num of them are added. listed, shading, irradiance, curves: as in
            `project_points`.
        begin: the point's first entry. out: added to.
    """
    overlaps, weight, num_bands, active = subtriangles.overlaps, subtriangles.weight, curves.num_bands, curves.active
    _weight(subtriangles, num, listed, shading, begin, irradiance)
    for k in range(num_bands.shape[0]):
        if k != active and curves.setting_index[k] < 0:
            _overlaps(subtriangles.corners[k], num_bands[k], num, overlaps)
            bands, decrements = curves.bands[k], curves.decrements[k]
            _multiply_means(overlaps, bands, decrements, num_bands[k], curves.num_rows[k], num, weight)
    if active >= 0:
        _overlaps(subtriangles.corners[active], num_bands[active], num, overlaps)
        _deposit(overlaps, num_bands[active], num, weight, out)
    elif curves.settings.shape[0] > 0:
        _add_settings(subtriangles, num, curves, out)
    else:
        for channel in range(3):
            total = np.float32(0)
            for n in range(num):
                total += weight[channel, n]
            out[channel, 0] += total
