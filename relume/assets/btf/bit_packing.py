"""Unpacking of small integers: clusters and weights of older BTFs on disk.

A row is C numbers of b_j bits, with sign: n is stored as n + 2^(b_j − 1) − 1, most significant bit first.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

I8 = NDArray[np.int8]
U8 = NDArray[np.uint8]


def max_code(bits: Shaped[NDArray[np.integer], " columns"]) -> Shaped[NDArray[np.int64], " columns"]:
    """Largest magnitude that fits with both signs: 2^(b − 1) − 1."""
    return np.asarray(2 ** (bits.astype(np.int64) - 1) - 1)


def cluster_bits(num: int) -> int:
    """Number of bits for the index of one of `num` clusters."""
    return max(1, (num - 1).bit_length())


def packed_bytes(num: int, bits: Shaped[U8, " columns"]) -> int:
    """Number of bytes for `num` rows."""
    return -(-num * int(bits.sum(dtype=np.int64)) // 8)


def unpack(data: Shaped[U8, " bytes"], bits: Shaped[U8, " columns"], num: int) -> Shaped[I8, "n columns"]:
    """Unpack rows of small integers.

    Args:
        data: `packed_bytes` bytes. bits: bits per value of each column, 1 to 8. num: number of rows.
    """
    flags = np.unpackbits(data)[: num * int(bits.sum(dtype=np.int64))].reshape(num, -1)
    ends = np.cumsum([0, *bits])
    columns = [flags[:, ends[j] : ends[j + 1]] @ (1 << np.arange(width)[::-1]) for j, width in enumerate(bits)]
    return np.asarray(np.array(columns, np.int64).reshape(len(bits), num).T - max_code(bits), np.int8)
