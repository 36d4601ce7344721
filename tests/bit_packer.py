"""Bit packing as in older stores of BTFs."""

import numpy as np

from relume.assets.btf.bit_packing import max_code


def pack(rows, bits):
    """Pack rows (n, C), each column in its number of bits, most significant first."""
    shifted = (rows + max_code(bits)).astype(np.uint8)
    columns = [np.unpackbits(column[:, None], axis=1)[:, 8 - b :] for column, b in zip(shifted.T, bits, strict=True)]
    return np.packbits(np.concatenate([np.zeros((len(rows), 0), np.uint8), *columns], axis=1))
