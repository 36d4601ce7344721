"""An operator of some samples, for pictures whose operator of all would not fit the memory.

    R' = R + W T Δc

T are the columns at the chosen samples, W says how all others change with them. An image keeps what it has of shadows,
edges and bumps, which only its change knows coarsely (docs/adr/0083-operators-of-some-samples.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.operators.frozen import Frozen, packed_bytes
from relume.operators.operator import Operator
from relume.operators.packed import Packed
from relume.parallel import for_shares
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_NEAR = 3  # chosen samples that a sample changes with
_BYTES_NEAR = 8 * NUM_NEAR


@dataclass(frozen=True)
class Thin(Operator):
    """The operator of a term at chosen samples, and what all others take of it.

    Attributes:
        few: of the chosen samples. num_few: their number.
        near: chosen samples that each changes with. (n, k) int32
        weight: of each of them; rows sum to one. (n, k) float32
    """

    few: Frozen | Packed
    num_few: int
    near: NDArray[np.int32]
    weight: F32
    importance: F64 = field(init=False)

    is_whole = False
    is_exact = False

    def __post_init__(self) -> None:
        scale = np.sqrt(len(self.near) / max(1, self.num_few))  # a chosen sample stands for so many
        object.__setattr__(self, "importance", self.few.importance * scale)

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.few.num_bytes + self.near.nbytes + self.weight.nbytes

    def add(self, change: F64, image: F32) -> None:
        """Add W Σ_j Δc_j T_j to an image; see `Operator`."""
        tiles, _, _, samples = self.few.transport.shape
        changed = np.zeros((tiles, 3, samples), np.float32)
        self.few.add(change, changed)
        spread(np.ascontiguousarray(changed.transpose(0, 2, 1).reshape(-1, 3)), self.near, self.weight, image)

    def columns_at(self, sample: int) -> F64:
        """What each coefficient gives to one sample, as far as the chosen ones tell. (3, J)"""
        columns = [self.few.columns_at(int(row)) for row in self.near[sample]]
        return np.asarray(np.tensordot(self.weight[sample].astype(np.float64), columns, 1))


def thin_bytes(num_samples: int, num_few: int, num_bands: int) -> int:
    """Memory that an operator of some of a term's samples needs to keep.

    Args:
        num_samples: of the term. num_few: of them, chosen. num_bands: columns of each channel.
    """
    return packed_bytes(num_few, num_bands) + num_samples * _BYTES_NEAR


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _spread(rows, near, weight, image, start, stop):  # type: ignore[no-untyped-def]
    """Add to tiles [start, stop) of an image."""
    samples, num = image.shape[2], near.shape[1]
    for tile in range(start, stop):
        first = tile * samples
        for s in range(min(samples, near.shape[0] - first)):
            red = green = blue = np.float32(0)
            for k in range(num):
                row, w = near[first + s, k], weight[first + s, k]
                red += w * rows[row, 0]
                green += w * rows[row, 1]
                blue += w * rows[row, 2]
            image[tile, 0, s] += red
            image[tile, 1, s] += green
            image[tile, 2, s] += blue


def spread(rows: F32, near: NDArray[np.int32], weight: F32, image: F32) -> None:
    """Add to every sample of an image the weighted sum of what is at some, in place.

    Args:
        rows: at those. (m, 3) float32, C order. near: which of them each sample takes. (n, k) int32
        weight: how much of each. (n, k) float32
        image: added to. (tiles, 3, samples) float32 that hold n samples
    """
    for_shares(lambda start, stop: _spread(rows, near, weight, image, start, stop), len(image))
