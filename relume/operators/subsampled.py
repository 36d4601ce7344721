"""An operator at a subset of samples, for images whose full operator would exceed the memory.

    R' = R + W T Δc

T are the columns at the selected samples, W interpolates their changes to all others. The image keeps its shadows,
edges and normal-mapped detail; only its change is coarse (docs/direct-light.md#algorithm).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.operators.linear_operator import LinearOperator, quantized_bytes
from relume.operators.operator import Operator
from relume.operators.quantized import QuantizedOperator

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_NEIGHBORS = 3  # selected samples that a sample is interpolated from
_NEIGHBOR_BYTES = 8 * NUM_NEIGHBORS


@dataclass(frozen=True)
class SubsampledOperator(Operator):
    """The operator of a term at selected samples, with interpolation weights for all others.

    Attributes:
        subset_operator: at the selected samples. num_subset: their number.
        neighbors: selected samples around each sample. weight: weight of these; rows sum to one.
    """

    subset_operator: LinearOperator | QuantizedOperator
    num_subset: int
    neighbors: Shaped[NDArray[np.int32], "n k"]
    weight: Shaped[F32, "n k"]
    importance: Shaped[F64, "*levels 3 J"] = field(init=False)

    is_whole = False
    is_exact = False

    def __post_init__(self) -> None:
        scale = np.sqrt(len(self.neighbors) / max(1, self.num_subset))  # samples per selected sample
        object.__setattr__(self, "importance", self.subset_operator.importance * scale)

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.subset_operator.num_bytes + self.neighbors.nbytes + self.weight.nbytes

    def add(self, change: Shaped[F64, "*levels 3 J"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Add W Σ_j Δc_j T_j to an image; see `Operator`."""
        tiles, _, _, samples = self.subset_operator.transport.shape
        subset_change = np.zeros((tiles, 3, samples), np.float32)
        self.subset_operator.add(change, subset_change)
        interpolate(
            np.ascontiguousarray(subset_change.transpose(0, 2, 1).reshape(-1, 3)), self.neighbors, self.weight, image
        )

    def columns_at(self, sample: int) -> Shaped[F64, "3 J"]:
        """Return the interpolated column values at one sample."""
        columns = [self.subset_operator.columns_at(int(row)) for row in self.neighbors[sample]]
        return np.asarray(np.tensordot(self.weight[sample].astype(np.float64), columns, 1))


def subsampled_bytes(num_samples: int, num_subset: int, num_bands: int) -> int:
    """Return the memory of an operator at a subset of a term's samples.

    Args:
        num_samples: number of samples of the term. num_subset: selected samples. num_bands: columns per channel.
    """
    return quantized_bytes(num_subset, num_bands) + num_samples * _NEIGHBOR_BYTES


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
