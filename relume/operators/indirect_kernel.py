"""Kernels of `relume.operators.indirect`: ray weights summed per patch, and their sparse Haar transform."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.patches.patch_kdtree import NO_PATCH

BLOCK_SAMPLES = 64
MAX_CODE = 32_767  # of 16-bit weights
_HALF = np.float32(math.sqrt(0.5))


@nb.njit(nogil=True, cache=True)
def number_patches(gather_hits, start, stop, patch_row):  # type: ignore[no-untyped-def]
    """Number the patches that samples [start, stop) hit, ascending; gather_hits: patches that rays hit. (n, rays)

    Writes patch_row (patches,) int32, −1 for a patch that is not hit; returns the patches hit.
    """
    patch_row[:] = -1
    for p in range(start, stop):
        for ray in range(gather_hits.shape[1]):
            if gather_hits[p, ray] != NO_PATCH:
                patch_row[gather_hits[p, ray]] = 0
    num_patches = 0
    for patch in range(patch_row.shape[0]):
        if patch_row[patch] == 0:
            patch_row[patch] = num_patches
            num_patches += 1
    patches = np.empty(num_patches, np.int32)
    for patch in range(patch_row.shape[0]):
        if patch_row[patch] >= 0:
            patches[patch_row[patch]] = patch
    return patches


@nb.njit(nogil=True, cache=True, fastmath=True, **NO_REFCOUNT)
def sum_by_patch(gather_hits, start, stop, patch_row, weight, sums):  # type: ignore[no-untyped-def]
    """Add the weights of the rays of samples [start, stop) to the patches that they hit.

    Args:
        gather_hits: patches that rays hit. (n, rays) uint16. patch_row: from `number_patches`. (patches,) int32
        weight: weights of the rays, in the order of `list_gather_rays`. (channels, K) float32
        sums: added to. (patches hit, channels, samples) float32
    """
    ray_index = 0
    for p in range(start, stop):
        for ray in range(gather_hits.shape[1]):
            patch = gather_hits[p, ray]
            if patch != NO_PATCH:
                for channel in range(sums.shape[1]):
                    sums[patch_row[patch], channel, p - start] += weight[channel, ray_index]
                ray_index += 1


@nb.njit(nogil=True, cache=True, fastmath=True)
def transform(patches, sums, num_levels, index, details):  # type: ignore[no-untyped-def]
    """Compute the Haar coefficients of sparse columns; both arguments are overwritten.

    Args:
        patches: nonzero patches, ascending. (n,) int32. sums: their values. (n, width) float32.
        num_levels: number of levels of all patches, padded.
    Writes index (≥ m,) and details (≥ m, width); returns m.
    """
    num, end = patches.shape[0], 0
    for level in range(num_levels - 1, -1, -1):
        at = read = 0
        while read < num:
            node = patches[read] >> 1
            index[end] = (1 << level) + node
            if read + 1 < num and patches[read + 1] >> 1 == node:
                for s in range(sums.shape[1]):
                    first, second = sums[read, s], sums[read + 1, s]
                    details[end, s] = _HALF * (first - second)
                    sums[at, s] = _HALF * (first + second)
                read += 2
            else:
                sign = np.float32(1 - 2 * (patches[read] & 1))
                for s in range(sums.shape[1]):
                    value = _HALF * sums[read, s]
                    details[end, s] = sign * value
                    sums[at, s] = value
                read += 1
            patches[at] = node
            at += 1
            end += 1
        num = at
    index[end] = 0
    for s in range(sums.shape[1]):
        details[end, s] = sums[0, s]
    return end + 1


@nb.njit(nogil=True, cache=True, fastmath=True)
def select_coefficients(index, details, expected, coefficients, scale, rows):  # type: ignore[no-untyped-def]
    """Select the coefficients that change the samples most, as 16-bit weights.

    Args:
        index: indices of the coefficients. (m,) details: (m, width).
        expected: expected magnitudes of the light's coefficients. (padded patches,) float32
    Writes coefficients (K,) int32, scale (K,) float32, rows (K, width) int16; zero if there are fewer than K.
    """
    importance = np.empty(index.shape[0], np.float32)
    for m in range(index.shape[0]):
        squared_norm = np.float32(0)
        for s in range(details.shape[1]):
            squared_norm += details[m, s] * details[m, s]
        importance[m] = squared_norm * expected[index[m]] ** 2
    num_dropped = index.shape[0] - coefficients.shape[0]
    threshold = np.sort(importance)[num_dropped] if num_dropped > 0 else np.float32(0)
    slot = 0
    # from coarse to fine: of equally important coefficients the finest are omitted
    for m in range(index.shape[0] - 1, -1, -1):
        if importance[m] < threshold or slot == coefficients.shape[0]:
            continue
        largest = np.float32(0)
        for s in range(details.shape[1]):
            largest = max(largest, abs(details[m, s]))
        step = largest / np.float32(MAX_CODE)
        if step > 0:
            coefficients[slot], scale[slot] = index[m], step
            for s in range(details.shape[1]):
                rows[slot, s] = np.int16(math.floor(details[m, s] / step + np.float32(0.5)))
            slot += 1
    coefficients[slot:], scale[slot:], rows[slot:] = 0, 0, 0


@nb.njit(nogil=True, cache=True, fastmath=True)
def apply_rows(coefficients, scale, rows, light, start, stop, unfiltered):  # type: ignore[no-untyped-def]
    """Compute the reflected light of blocks [start, stop), before filtering.

    Args:
        coefficients, scale: (blocks, K). rows: (blocks, K, 1 or 3 channels, `BLOCK_SAMPLES`) int16.
        light: Haar coefficients. (padded patches, 3) float32
    Writes unfiltered (blocks · `BLOCK_SAMPLES`, 4) float32; the last channel is unused.
    """
    num_channels = rows.shape[2]
    # separate arrays, so that the compiler can rule out aliasing
    red, green, blue = (
        np.empty(BLOCK_SAMPLES, np.float32), np.empty(BLOCK_SAMPLES, np.float32), np.empty(BLOCK_SAMPLES, np.float32)
    )  # fmt: skip
    for block in range(start, stop):
        red[:], green[:], blue[:] = 0, 0, 0
        for k in range(coefficients.shape[1]):
            step, coefficient = scale[block, k], coefficients[block, k]
            r, g, b = step * light[coefficient, 0], step * light[coefficient, 1], step * light[coefficient, 2]
            if num_channels == 1:
                row = rows[block, k, 0]
                for s in range(BLOCK_SAMPLES):
                    weight = np.float32(row[s])
                    red[s] += r * weight
                    green[s] += g * weight
                    blue[s] += b * weight
            else:
                red_row, green_row, blue_row = rows[block, k, 0], rows[block, k, 1], rows[block, k, 2]
                for s in range(BLOCK_SAMPLES):
                    red[s] += r * np.float32(red_row[s])
                    green[s] += g * np.float32(green_row[s])
                    blue[s] += b * np.float32(blue_row[s])
        first = block * BLOCK_SAMPLES
        for s in range(BLOCK_SAMPLES):
            unfiltered[first + s, 0], unfiltered[first + s, 1], unfiltered[first + s, 2] = red[s], green[s], blue[s]
