"""frame.bandwidth_ratio: fraction of the memory's read bandwidth that an incremental update uses.

Numerator: bytes per second of the operator that `relume.operators.update_kernel.stream` reads for 30 random columns of
256 (different ones each time, so that no cache contains them) at 512×512×RGB. Denominator: the same array summed from
end to end by the same threads. Both alternate; the best of each counts, because other programs can only slow them down.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.core.thread_pools import for_ranges, num_threads
from relume.operators.linear_operator import tile_layout
from relume.operators.update_kernel import changed_columns, stream
from relume_bench.figure import Figure
from relume_bench.timing import time_interleaved

_NUM_BANDS, _NUM_COLUMNS = 256, 30
_FLOATS_A_RANGE = 1 << 22


@nb.njit(nogil=True, cache=True, fastmath=True)
def _sum(values, start, stop):  # type: ignore[no-untyped-def]
    block = values[start:stop]
    total = np.float32(0)
    for k in range(block.shape[0]):
        total += block[k]
    return total


def measure(tiny: bool) -> list[Figure]:
    """Time both sides on the same 805 MB, alternating."""
    side = 64 if tiny else 512
    tiles, samples = tile_layout(side * side)
    transport = np.full((tiles, 3, _NUM_BANDS, samples), 1e-6, np.float32)
    image = np.zeros((tiles, 3, samples), np.float32)
    flat = transport.reshape(-1)
    rng = np.random.default_rng(1)

    def update() -> None:
        change = np.zeros((3, _NUM_BANDS))
        for channel in range(3):
            change[channel, rng.permutation(_NUM_BANDS)[:_NUM_COLUMNS]] = 0.5
        stream(transport, changed_columns(change), image)

    def read() -> None:
        for_ranges(lambda start, stop: _sum(flat, start, stop), flat.size, _FLOATS_A_RANGE)

    updates, reads = time_interleaved([update, read], 2 if tiny else 40)
    update_bytes, read_bytes = 4 * 3 * _NUM_COLUMNS * tiles * samples, flat.nbytes
    streamed, bandwidth = update_bytes / min(updates), read_bytes / min(reads)
    context = {
        "update_ms_best": 1e3 * min(updates),
        "update_ms_median": 1e3 * float(np.median(updates)),
        "streamed_GB_per_s": streamed / 1e9,
        "read_GB_per_s": bandwidth / 1e9,
        "ratio_of_medians": (update_bytes / float(np.median(updates))) / (read_bytes / float(np.median(reads))),
        "threads": num_threads(),
    }
    return [Figure("frame.bandwidth_ratio", streamed / bandwidth, "ratio", context)]
