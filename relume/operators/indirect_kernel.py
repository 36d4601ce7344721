"""The kernels of `relume.operators.indirect`: ray weights summed for each cell, transformed where they are not zero."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.trace.cell_tree import NO_CELL
from relume.uncounted import UNCOUNTED

BLOCK_SAMPLES = 64
STEPS = 32_767  # of 16-bit weights
_HALF = np.float32(math.sqrt(0.5))


@nb.njit(nogil=True, cache=True)
def number_cells(links, start, stop, place):  # type: ignore[no-untyped-def]
    """Number the cells that samples [start, stop) see, in their order; links: cells that their rays hit. (n, rays)

    Writes place (cells,) int32, −1 where a cell is not seen; returns the cells seen, rising.
    """
    place[:] = -1
    for p in range(start, stop):
        for ray in range(links.shape[1]):
            if links[p, ray] != NO_CELL:
                place[links[p, ray]] = 0
    num = 0
    for cell in range(place.shape[0]):
        if place[cell] == 0:
            place[cell] = num
            num += 1
    seen = np.empty(num, np.int32)
    for cell in range(place.shape[0]):
        if place[cell] >= 0:
            seen[place[cell]] = cell
    return seen


@nb.njit(nogil=True, cache=True, fastmath=True, **UNCOUNTED)
def sum_by_cell(links, start, stop, place, weight, sums):  # type: ignore[no-untyped-def]
    """Add the weights of the rays of samples [start, stop) to those of the cells that they hit.

    Args:
        links: cells that rays hit. (n, rays) uint16. place: from `number_cells`. (cells,) int32
        weight: of the rays, in the order of `list_rays`. (channels, K) float32
        sums: added to. (cells seen, channels, samples) float32
    """
    k = 0
    for p in range(start, stop):
        for ray in range(links.shape[1]):
            cell = links[p, ray]
            if cell != NO_CELL:
                for channel in range(sums.shape[1]):
                    sums[place[cell], channel, p - start] += weight[channel, k]
                k += 1


@nb.njit(nogil=True, cache=True, fastmath=True)
def transform(seen, sums, num_levels, index, details):  # type: ignore[no-untyped-def]
    """Haar coefficients of columns that are zero but for the cells seen; both arguments are overwritten.

    Args:
        seen: cells, rising. (n,) int32. sums: their values. (n, width) float32. num_levels: of all cells, padded.
    Writes index (≥ m,) and details (≥ m, width); returns m.
    """
    num, end = seen.shape[0], 0
    for level in range(num_levels - 1, -1, -1):
        at = read = 0
        while read < num:
            node = seen[read] >> 1
            index[end] = (1 << level) + node
            if read + 1 < num and seen[read + 1] >> 1 == node:
                for s in range(sums.shape[1]):
                    first, second = sums[read, s], sums[read + 1, s]
                    details[end, s] = _HALF * (first - second)
                    sums[at, s] = _HALF * (first + second)
                read += 2
            else:
                sign = np.float32(1 - 2 * (seen[read] & 1))
                for s in range(sums.shape[1]):
                    value = _HALF * sums[read, s]
                    details[end, s] = sign * value
                    sums[at, s] = value
                read += 1
            seen[at] = node
            at += 1
            end += 1
        num = at
    index[end] = 0
    details[end] = sums[0]
    return end + 1


@nb.njit(nogil=True, cache=True, fastmath=True)
def keep(index, details, expected, kept, scale, rows):  # type: ignore[no-untyped-def]
    """Keep the coefficients that move the samples most, as 16-bit weights.

    Args:
        index: of coefficients. (m,) details: (m, width). expected: of the light's. (padded cells,) float32
    Writes kept (K,) int32, scale (K,) float32, rows (K, width) int16, zero where there are fewer than K.
    """
    importance = np.empty(index.shape[0], np.float32)
    for m in range(index.shape[0]):
        squares = np.float32(0)
        for s in range(details.shape[1]):
            squares += details[m, s] * details[m, s]
        importance[m] = squares * expected[index[m]] ** 2
    spare = index.shape[0] - kept.shape[0]
    least = np.partition(importance, spare)[spare] if spare > 0 else np.float32(0)
    at = 0
    # from coarse to fine: of those that matter alike the finest are left out
    for m in range(index.shape[0] - 1, -1, -1):
        if importance[m] < least or at == kept.shape[0]:
            continue
        largest = np.float32(0)
        for s in range(details.shape[1]):
            largest = max(largest, abs(details[m, s]))
        step = largest / np.float32(STEPS)
        if step > 0:
            kept[at], scale[at] = index[m], step
            for s in range(details.shape[1]):
                rows[at, s] = np.int16(math.floor(details[m, s] / step + np.float32(0.5)))
            at += 1
    kept[at:], scale[at:], rows[at:] = 0, 0, 0


@nb.njit(nogil=True, cache=True, fastmath=True)
def apply_rows(kept, scale, rows, light, start, stop, alone):  # type: ignore[no-untyped-def]
    """What blocks [start, stop) make of light.

    Args:
        kept, scale: (blocks, K). rows: (blocks, K, 1 or 3 channels, `BLOCK_SAMPLES`) int16.
        light: Haar coefficients. (padded cells, 3) float32
    Writes alone (blocks · `BLOCK_SAMPLES`, 4) float32, whose last channel says nothing.
    """
    num_channels = rows.shape[2]
    # arrays of their own, so that the compiler knows that they do not overlap
    red, green, blue = (
        np.empty(BLOCK_SAMPLES, np.float32), np.empty(BLOCK_SAMPLES, np.float32), np.empty(BLOCK_SAMPLES, np.float32)
    )  # fmt: skip
    for block in range(start, stop):
        red[:], green[:], blue[:] = 0, 0, 0
        for k in range(kept.shape[1]):
            step, coefficient = scale[block, k], kept[block, k]
            r, g, b = step * light[coefficient, 0], step * light[coefficient, 1], step * light[coefficient, 2]
            if num_channels == 1:
                row = rows[block, k, 0]
                for s in range(BLOCK_SAMPLES):
                    weight = np.float32(row[s])
                    red[s] += r * weight
                    green[s] += g * weight
                    blue[s] += b * weight
            else:
                of_red, of_green, of_blue = rows[block, k, 0], rows[block, k, 1], rows[block, k, 2]
                for s in range(BLOCK_SAMPLES):
                    red[s] += r * np.float32(of_red[s])
                    green[s] += g * np.float32(of_green[s])
                    blue[s] += b * np.float32(of_blue[s])
        first = block * BLOCK_SAMPLES
        for s in range(BLOCK_SAMPLES):
            alone[first + s, 0], alone[first + s, 1], alone[first + s, 2] = red[s], green[s], blue[s]


@nb.njit(nogil=True, cache=True, fastmath=True, **UNCOUNTED)
def add_shared(first, among, weight, alone, start, stop, image):  # type: ignore[no-untyped-def]
    """Add to samples [start, stop) of an image the weighted means of what samples have alone.

    Args:
        first, among, weight: rows of `relume.views.sharing`, compressed. alone: from `apply_rows`.
        image: (tiles, 3, samples) float32
    """
    samples = image.shape[2]
    for s in range(start, stop):
        red = green = blue = np.float32(0)
        for k in range(first[s], first[s + 1]):
            w, beside = weight[k], np.uint32(among[k])
            red += w * alone[beside, 0]
            green += w * alone[beside, 1]
            blue += w * alone[beside, 2]
        tile, offset = s // samples, s % samples
        image[tile, 0, offset] += red
        image[tile, 1, offset] += green
        image[tile, 2, offset] += blue
