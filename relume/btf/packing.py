"""Whole numbers of a few bits each, without gaps: clusters and weights of a BTF on the disk.

A row is C numbers of b_j bits, sign included: n is written as n + 2^(b_j − 1) − 1, its highest bit first.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.uncounted import UNCOUNTED

I8 = NDArray[np.int8]
U8 = NDArray[np.uint8]


def largest(bits: NDArray[np.integer]) -> NDArray[np.int64]:
    """The largest number of so many bits, that is as far from zero as the least: 2^(b − 1) − 1. (C,)"""
    return np.asarray(2 ** (bits.astype(np.int64) - 1) - 1)


def cluster_bits(num: int) -> int:
    """That tell which of so many clusters a texel is in."""
    return max(1, (num - 1).bit_length())


def packed(rows: I8, bits: U8) -> U8:
    """Pack rows.

    Args:
        rows: (n, C), none below −`largest` of its bits, none above that + 1. bits: of each column, 1 to 8. (C,)
    Returns:
        (bytes,) of `packed_bytes`
    """
    shifted = (rows + largest(bits)).astype(np.uint8)
    columns = [np.unpackbits(column[:, None], axis=1)[:, 8 - b :] for column, b in zip(shifted.T, bits, strict=True)]
    return np.packbits(np.concatenate([np.zeros((len(rows), 0), np.uint8), *columns], axis=1))


def packed_bytes(num: int, bits: U8) -> int:
    """Bytes of so many rows."""
    return -(-num * int(bits.sum(dtype=np.int64)) // 8)


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _unpack(found, bits, out):  # type: ignore[no-untyped-def]
    """found: (bytes,). out: (n, C), written"""
    at: Any = 0
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            width = np.int64(bits[column])
            byte = at >> 3
            two = np.int64(found[byte]) << 8
            if byte + 1 < found.shape[0]:
                two |= np.int64(found[byte + 1])
            number = (two >> (16 - (at & 7) - width)) & ((1 << width) - 1)
            out[row, column] = number - ((1 << (width - 1)) - 1)
            at += width


def unpacked(found: U8, bits: U8, num: int) -> I8:
    """Undo `packed`.

    Args:
        found: what it gave. bits: as there. num: of rows.
    Returns:
        (num, C)
    """
    out = np.empty((num, len(bits)), np.int8)
    _unpack(found, bits, out)
    return out
