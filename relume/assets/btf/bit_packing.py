"""Whole numbers of a few bits each, without gaps: clusters and weights of a BTF on the disk.

A row is C numbers of b_j bits, sign included: n is written as n + 2^(b_j − 1) − 1, its highest bit first.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED

I8 = NDArray[np.int8]
U8 = NDArray[np.uint8]


def max_code(bits: NDArray[np.integer]) -> NDArray[np.int64]:
    """The largest number of so many bits, that is as far from zero as the least: 2^(b − 1) − 1. (C,)"""
    return np.asarray(2 ** (bits.astype(np.int64) - 1) - 1)


def cluster_bits(num: int) -> int:
    """That tell which of so many clusters a texel is in."""
    return max(1, (num - 1).bit_length())


def pack(rows: I8, bits: U8) -> U8:
    """Pack rows.

    Args:
        rows: (n, C), none below −`max_code` of its bits, none above that + 1. bits: of each column, 1 to 8. (C,)
    Returns:
        (bytes,) of `packed_bytes`
    """
    shifted = (rows + max_code(bits)).astype(np.uint8)
    columns = [np.unpackbits(column[:, None], axis=1)[:, 8 - b :] for column, b in zip(shifted.T, bits, strict=True)]
    return np.packbits(np.concatenate([np.zeros((len(rows), 0), np.uint8), *columns], axis=1))


def packed_bytes(num: int, bits: U8) -> int:
    """Bytes of so many rows."""
    return -(-num * int(bits.sum(dtype=np.int64)) // 8)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _unpack_kernel(data, bits, out):  # type: ignore[no-untyped-def]
    """found: (bytes,). out: (n, C), written"""
    bit_offset: Any = 0
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            width = np.int64(bits[column])
            byte = bit_offset >> 3
            two_bytes = np.int64(data[byte]) << 8
            if byte + 1 < data.shape[0]:
                two_bytes |= np.int64(data[byte + 1])
            number = (two_bytes >> (16 - (bit_offset & 7) - width)) & ((1 << width) - 1)
            out[row, column] = number - ((1 << (width - 1)) - 1)
            bit_offset += width


def unpack(data: U8, bits: U8, num: int) -> I8:
    """Undo `packed`.

    Args:
        data: what it gave. bits: as there. num: of rows.
    Returns:
        (num, C)
    """
    out = np.empty((num, len(bits)), np.int8)
    _unpack_kernel(data, bits, out)
    return out
