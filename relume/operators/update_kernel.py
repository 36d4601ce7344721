"""The incremental update R += T · Δc: streams the changed columns of an operator (eq. 30, Ben-Artzi 2006).

The memory layout serves this access only: [tile][channel][coefficient][sample], with contiguous columns per tile.
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
