"""The orthonormal Haar transform over values in an order where neighbours are alike, such as gather cells in theirs.

Coefficient 0 is the mean, times the root of the length; of the others, 2^l to 2^(l + 1) − 1 are those of level l, from
coarse to fine: the difference of the two halves of a stretch of 1 / 2^l of the whole.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def padded_length(length: int) -> int:
    """The power of two that holds so many values."""
    return 1 << max(0, length - 1).bit_length()


def coefficient_levels(length: int) -> NDArray[np.int64]:
    """Level of each coefficient of a power of two, that of the mean counted as level 0. (length,)"""
    return np.frexp(np.maximum(np.arange(length), 1))[1].astype(np.int64) - 1


def haar(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Coefficients along the first axis, zeros appended up to a power of two. (n, ...) -> (padded length, ...)"""
    sums = np.zeros((padded_length(len(values)), *values.shape[1:]))
    sums[: len(values)] = values
    out = np.empty_like(sums)
    while len(sums) > 1:
        first, second = sums[::2], sums[1::2]
        out[len(first) : 2 * len(first)] = (first - second) * np.sqrt(0.5)
        sums = (first + second) * np.sqrt(0.5)
    out[:1] = sums
    return out
