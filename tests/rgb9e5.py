"""Shared-exponent pixels in plain NumPy: the reference of `relume.math.rgb9e5`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]
_MANTISSA_BITS = 9
_BIAS = 15
_MAX_EXPONENT = 31
RGB9E5_MAX = (2**_MANTISSA_BITS - 1) / 2**_MANTISSA_BITS * 2.0 ** (_MAX_EXPONENT - _BIAS)


def rgb9e5_pack(rgb: F32) -> U32:
    """Pixels with 9 bits per channel and a shared 5-bit exponent: EXT_texture_shared_exponent.

    Args:
        rgb: linear; negative values and NaN become zero, large ones 65408. (..., 3)
    Returns:
        Red in the lowest bits, the exponent in the highest. (...) uint32
    """
    clamped = np.fmin(np.fmax(np.asarray(rgb, np.float64), 0.0), RGB9E5_MAX)  # fmax prefers the number to NaN
    largest = clamped.max(axis=-1)
    _, exponent = np.frexp(largest)
    shared = np.where(largest > 0, np.maximum(exponent + _BIAS, 0), 0)
    # rounding up may overflow the mantissa
    shared += np.floor(np.ldexp(largest, _BIAS + _MANTISSA_BITS - shared) + 0.5) == 2**_MANTISSA_BITS
    mantissas = np.floor(np.ldexp(clamped, (_BIAS + _MANTISSA_BITS - shared)[..., None]) + 0.5).astype(np.uint32)
    packed = mantissas[..., 0] | mantissas[..., 1] << 9 | mantissas[..., 2] << 18
    return np.asarray(packed | shared.astype(np.uint32) << 27, np.uint32)


def rgb9e5_unpack(packed: U32) -> F32:
    """The linear RGB of shared-exponent pixels. (...) uint32 -> (..., 3) float32"""
    mantissas = packed[..., None] >> np.array([0, 9, 18], np.uint32) & np.uint32(511)
    exponent = (packed >> np.uint32(27)).astype(np.int32) - _BIAS - _MANTISSA_BITS
    return np.ldexp(mantissas.astype(np.float32), exponent[..., None])
