"""Bit packing of small integers: clusters and weights of a BTF on disk.

A row is C numbers of b_j bits, with sign: n is stored as n + 2^(b_j − 1) − 1, most significant bit first.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT

I8 = NDArray[np.int8]
U8 = NDArray[np.uint8]


def max_code(bits: Shaped[NDArray[np.integer], " columns"]) -> Shaped[NDArray[np.int64], " columns"]:
    """Largest magnitude that fits with both signs: 2^(b − 1) − 1."""
    return np.asarray(2 ** (bits.astype(np.int64) - 1) - 1)


def cluster_bits(num: int) -> int:
    """Number of bits for the index of one of `num` clusters."""
    return max(1, (num - 1).bit_length())


def pack(rows: Shaped[I8, "n columns"], bits: Shaped[U8, " columns"]) -> Shaped[U8, " bytes"]:
    """Pack rows into `packed_bytes` bytes.

    Args:
        rows: values from −`max_code` of the column's bits to `max_code` + 1.
        bits: bits per value of each column, 1 to 8.
    """
    shifted = (rows + max_code(bits)).astype(np.uint8)
    columns = [np.unpackbits(column[:, None], axis=1)[:, 8 - b :] for column, b in zip(shifted.T, bits, strict=True)]
    return np.packbits(np.concatenate([np.zeros((len(rows), 0), np.uint8), *columns], axis=1))


def packed_bytes(num: int, bits: Shaped[U8, " columns"]) -> int:
    """Number of bytes for `num` rows."""
    return -(-num * int(bits.sum(dtype=np.int64)) // 8)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _unpack_kernel(data, bits, out):  # type: ignore[no-untyped-def]
    """data: (bytes,). bits: (C,). out: (n, C), written"""
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


def unpack(data: Shaped[U8, " bytes"], bits: Shaped[U8, " columns"], num: int) -> Shaped[I8, "n columns"]:
    """Invert `pack`.

    Args:
        data: result of `pack`. bits: as in `pack`. num: number of rows.
    """
    out = np.empty((num, len(bits)), np.int8)
    _unpack_kernel(data, bits, out)
    return out
