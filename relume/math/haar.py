"""Orthonormal Haar transform of values ordered so that neighbors are similar, such as patches in their order.

Coefficient 0 is the mean times the root of the length. Coefficients 2^l to 2^(l + 1) − 1 have level l, from coarse to
fine: the difference of the two halves of an interval of 1 / 2^l of the whole.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray


def padded_length(length: int) -> int:
    """Smallest power of two that is at least `length`."""
    return 1 << max(0, length - 1).bit_length()


def coefficient_levels(length: int) -> Shaped[NDArray[np.int64], " length"]:
    """Level of each of `length` coefficients, a power of two; the mean counts as level 0."""
    return np.frexp(np.maximum(np.arange(length), 1))[1].astype(np.int64) - 1


def haar(values: Shaped[NDArray[np.floating], "n ..."]) -> Shaped[NDArray[np.float64], "padded ..."]:
    """Haar coefficients along the first axis, which is padded with zeros to a power of two."""
    sums = np.zeros((padded_length(len(values)), *values.shape[1:]))
    sums[: len(values)] = values
    out = np.empty_like(sums)
    while len(sums) > 1:
        first, second = sums[::2], sums[1::2]
        out[len(first) : 2 * len(first)] = (first - second) * np.sqrt(0.5)
        sums = (first + second) * np.sqrt(0.5)
    out[:1] = sums
    return out
