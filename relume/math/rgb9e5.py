"""Colors in 32 bits: RGB9_E5 of OpenGL, EXT_texture_shared_exponent."""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np

from relume.core.numba_options import NO_REFCOUNT

_BIAS, _MANTISSA_BITS, _LARGEST = 15, 9, np.float32(65408.0)
_FLOAT_BIAS = 127


@nb.njit(nogil=True, cache=True, error_model="numpy", **NO_REFCOUNT)
def pack_rgb9e5(red: Any, green: Any, blue: Any) -> Any:
    """Pack a pixel's red, green and blue into 32 bits: 9-bit mantissas, red lowest, and a shared 5-bit exponent."""
    red = min(red, _LARGEST) if red > 0 else np.float32(0)  # NaN becomes zero
    green = min(green, _LARGEST) if green > 0 else np.float32(0)
    blue = min(blue, _LARGEST) if blue > 0 else np.float32(0)
    largest = max(red, max(green, blue))
    # read and write exponents in the bits of a float32: three times as fast as frexp and ldexp
    shared: Any = max(0, (np.float32(largest).view(np.int32) >> 23) - _FLOAT_BIAS + 1 + _BIAS)
    scale = np.int32((_MANTISSA_BITS + _BIAS - shared + _FLOAT_BIAS) << 23).view(np.float32)
    if np.int32(np.float64(largest * scale) + 0.5) == 1 << _MANTISSA_BITS:  # rounding up needs one more bit
        shared += 1
        scale *= np.float32(0.5)
    # in float64: in float32 the largest float below 0.5, plus 0.5, would round to 1
    r = np.uint32(np.int32(np.float64(red * scale) + 0.5))
    g = np.uint32(np.int32(np.float64(green * scale) + 0.5))
    b = np.uint32(np.int32(np.float64(blue * scale) + 0.5))
    return r | (g << np.uint32(9)) | (b << np.uint32(18)) | (np.uint32(shared) << np.uint32(27))


@nb.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def unpack_rgb9e5(packed: Any) -> Any:
    """Red, green and blue of a packed pixel, a tuple."""
    exponent = np.int32(packed >> np.uint32(27)) + np.int32(_FLOAT_BIAS - _BIAS - _MANTISSA_BITS)
    scale = np.int32(exponent << 23).view(np.float32)
    low, mask = np.uint32(packed), np.uint32(511)
    return (
        scale * np.float32(low & mask),
        scale * np.float32((low >> np.uint32(9)) & mask),
        scale * np.float32((low >> np.uint32(18)) & mask),
    )
