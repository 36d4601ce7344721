"""Bits of points and lights, turned over: rows of lights for each point, or words of points for each light."""

from __future__ import annotations

import numba as nb
import numpy as np

from relume.uncounted import UNCOUNTED

WORD = 64  # points whose bits a word holds


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _turn_over(words):  # type: ignore[no-untyped-def]
    """Let bit j of word k become bit k of word j: halves of the square change places, then halves of those. (64,)"""
    size, low = 32, np.uint64(0xFFFFFFFF)
    while size:
        for k in range(WORD):
            if not k & size:
                changed = (words[k] >> np.uint64(size) ^ words[k + size]) & low
                words[k] ^= changed << np.uint64(size)
                words[k + size] ^= changed
        size >>= 1
        low ^= low << np.uint64(size)


@nb.njit(nogil=True, cache=True)
def into_rows(words, rows):  # type: ignore[no-untyped-def]
    """Turn words of points into rows of lights.

    Args:
        words: bit k of each light's is point k. (M,) uint64
        rows: light m of a point in bit m & 7 of byte m >> 3, written. (at most 64, ≥ M / 8) uint8
    """
    square = np.empty(WORD, np.uint64)
    in_bytes = square.view(np.uint8)
    num_lights = words.shape[0]
    for first in range(0, num_lights, WORD):
        num = min(WORD, num_lights - first)
        square[:num] = words[first : first + num]
        square[num:] = 0
        _turn_over(square)
        begin, num_bytes = first >> 3, (num + 7) >> 3
        for k in range(rows.shape[0]):
            for byte in range(num_bytes):
                rows[k, begin + byte] = in_bytes[8 * k + byte]


@nb.njit(nogil=True, cache=True)
def into_words(rows, words):  # type: ignore[no-untyped-def]
    """Turn rows of lights into words of points, as `into_rows` does the other way round. words: written. (M,) uint64"""
    square = np.empty(WORD, np.uint64)
    in_bytes = square.view(np.uint8)
    num_lights = words.shape[0]
    for first in range(0, num_lights, WORD):
        num = min(WORD, num_lights - first)
        begin, num_bytes = first >> 3, (num + 7) >> 3
        square[:] = 0
        for k in range(rows.shape[0]):
            for byte in range(num_bytes):
                in_bytes[8 * k + byte] = rows[k, begin + byte]
        _turn_over(square)
        words[first : first + num] = square[:num]
