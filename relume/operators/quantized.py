"""An operator in half the memory: columns in 16 bits, with a scale per column and block of samples.

    T_ij ≈ s_bj n_ij,   n an integer of 16 bits, s_bj the largest |T_ij| of block b over 32,767

The rounding error of an entry is at most s/2: images of all columns are within 10⁻⁴ of those in float32, a third of the
error of float16 with the same memory (docs/direct-light.md#algorithm). An operator in use adds changes to an exact
image, so that only the change is rounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.operators.operator import Operator
from relume.operators.update_kernel import Columns, changed_columns, tile_offset

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

BLOCK_SAMPLES = 512
_MAX_CODE = 32_767


@dataclass(frozen=True)
class QuantizedOperator(Operator):
    """`relume.operators.linear_operator.LinearOperator` in 16 bits.

    Attributes:
        transport: integers. scale: their factors. importance, bounds: see `LinearOperator`.
    """

    transport: Shaped[NDArray[np.int16], "tiles 3 J samples"]
    scale: Shaped[F32, "tiles 3 J blocks"]
    importance: Shaped[F64, "*levels 3 J"]
    bounds: Shaped[NDArray[np.int64], " ends"] | None = None

    is_whole = True
    is_exact = False

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.transport.nbytes + self.scale.nbytes

    def add(self, change: Shaped[F64, "*levels 3 J"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Add Σ_j Δc_j T_j to an image; see `Operator`."""
        stream_quantized(self.transport, self.scale, changed_columns(change), image, self.bounds)

    def columns_at(self, sample: int) -> Shaped[F64, "3 J"]:
        """Return the column values at one sample."""
        tile, offset = divmod(sample, self.transport.shape[3])
        scale = self.scale[tile, :, :, offset // BLOCK_SAMPLES].astype(np.float64)
        return np.asarray(scale * self.transport[tile, :, :, offset])


def quantize(
    rows: Shaped[F32, "channels samples J"],
) -> tuple[Shaped[NDArray[np.int16], "channels samples J"], Shaped[F32, "channels J"]]:
    """Quantize the columns of one block of samples; returns integers and their scales."""
    scale = np.abs(rows).max(axis=1) / np.float32(_MAX_CODE)
    inverse_scale = np.divide(1, scale, out=np.zeros_like(scale), where=scale > np.finfo(np.float32).tiny)
    return np.rint(rows * inverse_scale[:, None]).clip(-_MAX_CODE, _MAX_CODE).astype(np.int16), scale


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _stream(transport, scale, bounds, index, change, count, image, start, stop):  # type: ignore[no-untyped-def]
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
    """Add T · Δc to an image, in place; see `relume.operators.update_kernel.stream`.

    Reads 2 · count · tiles · samples bytes per channel; memory-bound.

    Args:
        transport: quantized. scale: scale of its blocks. columns: from `changed_columns`.
        image: added to. bounds: bounds of the levels' samples, tile by tile; None for a single level.
    """
    if columns.count.any():
        if bounds is None:
            bounds = np.array([0, image.shape[0] * image.shape[2]], np.int64)
        args = (transport, scale, bounds, columns.index, columns.change, columns.count, image)
        parallel_for_chunks(lambda start, stop: _stream(*args, start, stop), 3 * len(image))
