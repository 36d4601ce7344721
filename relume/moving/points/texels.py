"""Kernels that look textures up where an eye sees them; as `relume.trace.surface` and `relume.trace.texture` do."""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np


@nb.njit(nogil=True, cache=True, inline="always")
def _texel(wrap, index, size):  # type: ignore[no-untyped-def]
    """Fold a texel's index into an image that is mirrored outside, or clamp it."""
    if wrap == 2:
        return min(max(index, 0), size - 1)
    folded = index % (2 * size)
    return min(folded, 2 * size - 1 - folded)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _two(wrap, place, size):  # type: ignore[no-untyped-def]
    """Find the two texels about a place along one side of an image, and the share of the second.

    place: of the image's side. size: texels along it.
    """
    if wrap == 0:
        place -= math.floor(place)  # so that what is outside is so by one texel at most, and nothing is divided
    at = place * np.float32(size) - np.float32(0.5)
    below = math.floor(at)
    first: Any = np.int64(below)
    second = first + 1
    if wrap == 0:
        return first + size if first < 0 else first, second - size if second >= size else second, np.float32(at - below)
    return _texel(wrap, first, size), _texel(wrap, second, size), np.float32(at - below)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_level(textures, texture, level, u, v, share, out):  # type: ignore[no-untyped-def]
    """Add a share of a bilinear lookup in one level of a texture. out: (3,)"""
    row = textures.first[texture] + level
    first, height, width = textures.levels[row, 0], textures.levels[row, 1], textures.levels[row, 2]
    left, right, fx = _two(textures.wraps[texture, 0], np.float32(u), width)
    upper, lower, fy = _two(textures.wraps[texture, 1], np.float32(v), height)
    one = np.float32(1)
    above, below = share * (one - fy), share * fy
    a, b, c, d = above * (one - fx), above * fx, below * (one - fx), below * fx
    at_a, at_b = first + upper * width + left, first + upper * width + right
    at_c, at_d = first + lower * width + left, first + lower * width + right
    texels = textures.texels
    for channel in range(3):
        out[channel] += (
            a * texels[at_a, channel]
            + b * texels[at_b, channel]
            + c * texels[at_c, channel]
            + d * texels[at_d, channel]
        )


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def sample_texture(textures, texture, u, v, footprint, out):  # type: ignore[no-untyped-def]
    """Look a texture up, trilinear.

    Args:
        textures: all of them. texture: number of one. u, v: the place. footprint: side of the filter in u and v.
        out: written. (3,)
    """
    first = textures.first[texture]
    last = textures.first[texture + 1] - first - 1
    size = max(textures.levels[first, 1], textures.levels[first, 2])
    level: Any = min(math.log2(max(np.float32(footprint * size), np.float32(1))), np.float32(last))
    lower = np.int64(level)
    share = np.float32(level - lower)
    out[:] = 0
    _add_level(textures, texture, lower, u, v, np.float32(1) - share, out)
    if share > 0:
        _add_level(textures, texture, lower + 1, u, v, share, out)
