"""Transpose visibility bits: rows of lights for each point, or words of points for each light."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT

WORD_BITS = 64  # points per word


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _transpose_bits(words):  # type: ignore[no-untyped-def]
    """Let bit j of word k become bit k of word j by swapping halves recursively. words: (64,)"""
    size, low = 32, np.uint64(0xFFFFFFFF)
    while size:
        for k in range(WORD_BITS):
            if not k & size:
                changed = (words[k] >> np.uint64(size) ^ words[k + size]) & low
                words[k] ^= changed << np.uint64(size)
                words[k + size] ^= changed
        size >>= 1
        low ^= low << np.uint64(size)


@nb.njit(nogil=True, cache=True)
def words_to_rows(words, rows):  # type: ignore[no-untyped-def]
    """Transpose words of points into rows of lights.

    Args:
        words: one per light; bit k is point k. (M,) uint64
        rows: output; light m of a point is bit m & 7 of byte m >> 3. (at most 64, ≥ M / 8) uint8
    """
    block = np.empty(WORD_BITS, np.uint64)
    in_bytes = block.view(np.uint8)
    num_lights = words.shape[0]
    for first in range(0, num_lights, WORD_BITS):
        num = min(WORD_BITS, num_lights - first)
        block[:num] = words[first : first + num]
        block[num:] = 0
        _transpose_bits(block)
        first_byte, num_bytes = first >> 3, (num + 7) >> 3
        for k in range(rows.shape[0]):
            for byte in range(num_bytes):
                rows[k, first_byte + byte] = in_bytes[8 * k + byte]


@nb.njit(nogil=True, cache=True)
def rows_to_words(rows, words):  # type: ignore[no-untyped-def]
    """Transpose rows of lights into words of points, the inverse of `words_to_rows`. words: output. (M,) uint64"""
    block = np.empty(WORD_BITS, np.uint64)
    in_bytes = block.view(np.uint8)
    num_lights = words.shape[0]
    for first in range(0, num_lights, WORD_BITS):
        num = min(WORD_BITS, num_lights - first)
        first_byte, num_bytes = first >> 3, (num + 7) >> 3
        block[:] = 0
        for k in range(rows.shape[0]):
            for byte in range(num_bytes):
                in_bytes[8 * k + byte] = rows[k, first_byte + byte]
        _transpose_bits(block)
        words[first : first + num] = block[:num]
