"""The incremental update R += T · Δc: streams the changed columns of an operator (eq. 30, Ben-Artzi 2006).

The memory layout serves this access only: [tile][channel][coefficient][sample], with contiguous columns per tile.
Compressed operators have columns in 16 bits, with a scale per block of samples, or columns of selected samples, whose
change is interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks

F32 = NDArray[np.float32]

# Long contiguous runs suit the hardware prefetcher: with 30 of 256 columns 16,384 samples read at 0.94 of the machine's
# bandwidth, 4,096 at 0.70 (docs/performance.md).
TILE_SAMPLES = 16_384
BLOCK_SAMPLES = 512  # with a common scale


@dataclass(frozen=True)
class Columns:
    """The changed coefficients, by level of the samples and by channel.

    Attributes:
        index: columns of each channel, ascending; only the first `count` of a row are valid.
        change: Δc of each. count: valid columns.
    """

    index: Shaped[NDArray[np.int32], "levels 3 n"]
    change: Shaped[F32, "levels 3 n"]
    count: Shaped[NDArray[np.int64], "levels 3"]


def changed_columns(change: Shaped[NDArray[np.float64], "*levels 3 J"]) -> Columns:
    """Return the columns with a nonzero change Δc."""
    change = change.reshape(-1, *change.shape[-2:])
    count = np.count_nonzero(change, axis=2)
    index = np.zeros((*count.shape, max(1, int(count.max()))), np.int32)
    values = np.zeros(index.shape, np.float32)
    for entry in np.ndindex(count.shape):
        changed = np.nonzero(change[entry])[0]
        index[entry][: len(changed)] = changed
        values[entry][: len(changed)] = change[entry][changed]
    return Columns(index, values, count.astype(np.int64))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def tile_offset(bounds, level, tile, samples):  # type: ignore[no-untyped-def]
    """Return the range of a level's samples in a tile; empty if the end is not above the begin.

    Args:
        bounds: see `stream`. level, tile: their indices. samples: samples of a tile.
    """
    return max(bounds[level] - tile * samples, 0), min(bounds[level + 1] - tile * samples, samples)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _stream(transport, bounds, index, change, count, image, start, stop):  # type: ignore[no-untyped-def]
    """Add the changed columns of planes [start, stop), a plane being a channel of a tile.

    Processes four columns at a time to reduce traffic of the image.
    """
    samples = image.shape[2]
    for plane in range(start, stop):
        tile, channel = plane // 3, plane % 3
        for level in range(count.shape[0]):
            first, last = tile_offset(bounds, level, tile, samples)
            if first >= last:
                continue
            sums = image[tile, channel, first:last]
            weight, column_index, num = change[level, channel], index[level, channel], count[level, channel]
            num_unrolled = num // 4 * 4
            for n in range(0, num_unrolled, 4):
                a = transport[tile, channel, column_index[n], first:last]
                b = transport[tile, channel, column_index[n + 1], first:last]
                c = transport[tile, channel, column_index[n + 2], first:last]
                d = transport[tile, channel, column_index[n + 3], first:last]
                wa, wb, wc, wd = weight[n], weight[n + 1], weight[n + 2], weight[n + 3]
                for s in range(sums.shape[0]):
                    sums[s] += wa * a[s] + wb * b[s] + wc * c[s] + wd * d[s]
            for n in range(num_unrolled, num):
                a, wa = transport[tile, channel, column_index[n], first:last], weight[n]
                for s in range(sums.shape[0]):
                    sums[s] += wa * a[s]


def stream(
    transport: Shaped[F32, "tiles 3 J samples"],
    columns: Columns,
    image: Shaped[F32, "tiles 3 samples"],
    bounds: Shaped[NDArray[np.int64], " ends"] | None = None,
) -> None:
    """Add T · Δc to an image, in place. Reads 4 · count · tiles · samples bytes per channel; memory-bound.

    Args:
        transport: transport of the operator. columns: from `changed_columns`.
        image: added to. bounds: bounds of the levels' samples, tile by tile; None for a single level.
    """
    if columns.count.any():
        if bounds is None:
            bounds = np.array([0, image.shape[0] * image.shape[2]], np.int64)
        args = (transport, bounds, columns.index, columns.change, columns.count, image)
        parallel_for_chunks(lambda start, stop: _stream(*args, start, stop), 3 * len(image))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _stream_quantized(transport, scale, bounds, index, change, count, image, start, stop):  # type: ignore[no-untyped-def]
    """Add the changed columns of planes [start, stop), a plane being a channel of a tile; four columns at a time."""
    samples = image.shape[2]
    for plane in range(start, stop):
        tile, channel = plane // 3, plane % 3
        for level in range(count.shape[0]):
            first, last = tile_offset(bounds, level, tile, samples)
            if first >= last:
                continue
            weight, column_index, num = change[level, channel], index[level, channel], count[level, channel]
            columns, scales = transport[tile, channel], scale[tile, channel]
            for n in range(0, num, 4):
                for block in range(first // BLOCK_SAMPLES, (last - 1) // BLOCK_SAMPLES + 1):
                    block_start, block_stop = max(first, block * BLOCK_SAMPLES), min(last, (block + 1) * BLOCK_SAMPLES)
                    sums = image[tile, channel, block_start:block_stop]
                    if n + 4 <= num:
                        a, b = (
                            columns[column_index[n], block_start:block_stop],
                            columns[column_index[n + 1], block_start:block_stop],
                        )
                        c, d = (
                            columns[column_index[n + 2], block_start:block_stop],
                            columns[column_index[n + 3], block_start:block_stop],
                        )
                        wa, wb = (
                            weight[n] * scales[column_index[n], block],
                            weight[n + 1] * scales[column_index[n + 1], block],
                        )
                        wc = weight[n + 2] * scales[column_index[n + 2], block]
                        wd = weight[n + 3] * scales[column_index[n + 3], block]
                        for s in range(block_stop - block_start):
                            sums[s] += wa * a[s] + wb * b[s] + wc * c[s] + wd * d[s]
                        continue
                    for m in range(n, num):
                        a, wa = (
                            columns[column_index[m], block_start:block_stop],
                            weight[m] * scales[column_index[m], block],
                        )
                        for s in range(block_stop - block_start):
                            sums[s] += wa * a[s]


def stream_quantized(
    transport: Shaped[NDArray[np.int16], "tiles 3 J samples"],
    scale: Shaped[F32, "tiles 3 J blocks"],
    columns: Columns,
    image: Shaped[F32, "tiles 3 samples"],
    bounds: Shaped[NDArray[np.int64], " ends"] | None = None,
) -> None:
    """Add T · Δc to an image, in place; see `stream`.

    Reads 2 · count · tiles · samples bytes per channel; memory-bound.

    Args:
        transport: quantized. scale: scale of its blocks. columns: from `changed_columns`.
        image: added to. bounds: bounds of the levels' samples, tile by tile; None for a single level.
    """
    if columns.count.any():
        if bounds is None:
            bounds = np.array([0, image.shape[0] * image.shape[2]], np.int64)
        args = (transport, scale, bounds, columns.index, columns.change, columns.count, image)
        parallel_for_chunks(lambda start, stop: _stream_quantized(*args, start, stop), 3 * len(image))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _interpolate(rows, neighbors, weight, image, start, stop):  # type: ignore[no-untyped-def]
    """Interpolate tiles [start, stop) of an image and add them."""
    samples, num = image.shape[2], neighbors.shape[1]
    for tile in range(start, stop):
        first = tile * samples
        for s in range(min(samples, neighbors.shape[0] - first)):
            red = green = blue = np.float32(0)
            for k in range(num):
                row, w = neighbors[first + s, k], weight[first + s, k]
                red += w * rows[row, 0]
                green += w * rows[row, 1]
                blue += w * rows[row, 2]
            image[tile, 0, s] += red
            image[tile, 1, s] += green
            image[tile, 2, s] += blue


def interpolate(
    rows: Shaped[F32, "m 3"],
    neighbors: Shaped[NDArray[np.int32], "n k"],
    weight: Shaped[F32, "n k"],
    image: Shaped[F32, "tiles 3 samples"],
) -> None:
    """Interpolate values of selected samples and add them to an image, in place.

    Args:
        rows: values of the selected samples, C order. neighbors: selected samples for each of n samples.
        weight: weight of these. image: added to; holds n samples.
    """
    parallel_for_chunks(lambda start, stop: _interpolate(rows, neighbors, weight, image, start, stop), len(image))
