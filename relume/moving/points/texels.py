"""Kernels that look textures up where an eye sees them; as `relume.trace.surface` and `relume.trace.texture` do."""

from __future__ import annotations

import math

import numba as nb
import numpy as np


@nb.njit(nogil=True, cache=True, inline="always")
def _texel(wrap, index, size):  # type: ignore[no-untyped-def]
    """Wrap a texel's index into an image."""
    if wrap == 2:
        return min(max(index, 0), size - 1)
    if wrap == 1:
        folded = index % (2 * size)
        return min(folded, 2 * size - 1 - folded)
    return index % size


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add_level(textures, texture, level, u, v, share, out):  # type: ignore[no-untyped-def]
    """Add a share of a bilinear lookup in one level of a texture. out: (3,)"""
    first, height, width = textures.levels[textures.first[texture] + level]
    x, y = u * width - 0.5, v * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - x0, y - y0
    for dy in range(2):
        row = first + _texel(textures.wraps[texture, 1], np.int64(y0) + dy, height) * width
        wy = share * (fy if dy else 1 - fy)
        for dx in range(2):
            at = row + _texel(textures.wraps[texture, 0], np.int64(x0) + dx, width)
            w = wy * (fx if dx else 1 - fx)
            for channel in range(3):
                out[channel] += w * textures.texels[at, channel]


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
    level = min(math.log2(max(footprint * size, 1.0)), last)
    lower = np.int64(level)
    share = level - lower
    out[:] = 0
    _add_level(textures, texture, lower, u, v, 1 - share, out)
    if share > 0:
        _add_level(textures, texture, min(lower + 1, last), u, v, share, out)
