"""Texture lookup in kernels, equal to `relume.raytrace.texture`."""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT
from relume.raytrace.texture import two_texels


# Inlined with its callees: calls would count references to arrays, which takes two thirds of the time of a lookup.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _add_level(textures, texture, level, u, v, weight, out):  # type: ignore[no-untyped-def]
    """Add the weighted bilinear lookup of one mip level. out: (3,)"""
    row = textures.first[texture] + level
    first, height, width = textures.levels[row, 0], textures.levels[row, 1], textures.levels[row, 2]
    left, right, fx = two_texels(textures.wraps[texture, 0], np.float32(u), width)
    upper, lower, fy = two_texels(textures.wraps[texture, 1], np.float32(v), height)
    unity = np.float32(1)
    above, below = weight * (unity - fy), weight * fy
    a, b, c, d = above * (unity - fx), above * fx, below * (unity - fx), below * fx
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


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def sample_texture(textures, texture, u, v, footprint, out):  # type: ignore[no-untyped-def]
    """Look up a texture, trilinear.

    Args:
        textures: all. texture: index. u, v: coordinates. footprint: side of the filter in texture units. out: written.
            (3,)
    """
    first = textures.first[texture]
    last = textures.first[texture + 1] - first - 1
    size = max(textures.levels[first, 1], textures.levels[first, 2])
    level: Any = min(math.log2(max(np.float32(footprint * size), np.float32(1))), np.float32(last))
    lower = np.int64(level)
    fraction = np.float32(level - lower)
    out[0] = out[1] = out[2] = 0  # assigning a slice is a call
    _add_level(textures, texture, lower, u, v, np.float32(1) - fraction, out)
    if fraction > 0:
        _add_level(textures, texture, lower + 1, u, v, fraction, out)
