"""An operator of some samples, for pictures whose operator of all would not fit the memory.

    R' = R + W T Δc

T are the columns at the chosen samples, W says how all others change with them. An image keeps what it has of shadows,
edges and bumps, which only its change knows coarsely (docs/direct-light.md#algorithm).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks
from relume.operators.linear_operator import LinearOperator, quantized_bytes
from relume.operators.operator import Operator
from relume.operators.quantized import QuantizedOperator

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_NEIGHBORS = 3  # chosen samples that a sample changes with
_NEIGHBOR_BYTES = 8 * NUM_NEIGHBORS


@dataclass(frozen=True)
class SubsampledOperator(Operator):
    """The operator of a term at chosen samples, and what all others take of it.

    Attributes:
        subset_operator: of the chosen samples. num_subset: their number.
        neighbors: chosen samples that each changes with. (n, k) int32
        weight: of each of them; rows sum to one. (n, k) float32
    """

    subset_operator: LinearOperator | QuantizedOperator
    num_subset: int
    neighbors: NDArray[np.int32]
    weight: F32
    importance: F64 = field(init=False)

    is_whole = False
    is_exact = False

    def __post_init__(self) -> None:
        scale = np.sqrt(len(self.neighbors) / max(1, self.num_subset))  # a chosen sample stands for so many
        object.__setattr__(self, "importance", self.subset_operator.importance * scale)

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.subset_operator.num_bytes + self.neighbors.nbytes + self.weight.nbytes

    def add(self, change: F64, image: F32) -> None:
        """Add W Σ_j Δc_j T_j to an image; see `Operator`."""
        tiles, _, _, samples = self.subset_operator.transport.shape
        subset_change = np.zeros((tiles, 3, samples), np.float32)
        self.subset_operator.add(change, subset_change)
        interpolate(
            np.ascontiguousarray(subset_change.transpose(0, 2, 1).reshape(-1, 3)), self.neighbors, self.weight, image
        )

    def columns_at(self, sample: int) -> F64:
        """What each coefficient gives to one sample, as far as the chosen ones tell. (3, J)"""
        columns = [self.subset_operator.columns_at(int(row)) for row in self.neighbors[sample]]
        return np.asarray(np.tensordot(self.weight[sample].astype(np.float64), columns, 1))


def subsampled_bytes(num_samples: int, num_subset: int, num_bands: int) -> int:
    """Memory that an operator of some of a term's samples needs to keep.

    Args:
        num_samples: of the term. num_subset: of them, chosen. num_bands: columns of each channel.
    """
    return quantized_bytes(num_subset, num_bands) + num_samples * _NEIGHBOR_BYTES


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _interpolate(rows, neighbors, weight, image, start, stop):  # type: ignore[no-untyped-def]
    """Add to tiles [start, stop) of an image."""
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


def interpolate(rows: F32, neighbors: NDArray[np.int32], weight: F32, image: F32) -> None:
    """Add to every sample of an image the weighted sum of what is at some, in place.

    Args:
        rows: at those. (m, 3) float32, C order. neighbors: which of them each sample takes. (n, k) int32
        weight: how much of each. (n, k) float32
        image: added to. (tiles, 3, samples) float32 that hold n samples
    """
    parallel_for_chunks(lambda start, stop: _interpolate(rows, neighbors, weight, image, start, stop), len(image))
