"""Color arithmetic on linear Rec. 709 RGB: luminance, the sRGB transfer curve, shared-exponent pixels."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
Floats = TypeVar("Floats", NDArray[np.float32], NDArray[np.float64])
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Y of linear Rec. 709 red, green and blue (ITU-R BT.709-6)."""

TO_XYZ = np.array(
    [
        [0.4123907993, 0.3575843394, 0.1804807884],
        [0.2126390059, 0.7151686788, 0.0721923154],
        [0.0193308187, 0.1191947798, 0.9505321522],
    ]
)
"""CIE 1931 XYZ of linear Rec. 709; white is D65 (IEC 61966-2-1)."""

LUMENS_PER_WATT = 683.0
"""Luminous efficacy of green light at 555 nm, by which photometric units become watts."""


def luminance(rgb: Shaped[F32, "*batch 3"]) -> F32:
    """Luminance Y of linear Rec. 709 RGB, for each pixel."""
    return rgb @ np.array(LUMINANCE, rgb.dtype)


def srgb_encode(linear: F32) -> F32:
    """Encode linear values as sRGB display values (IEC 61966-2-1), clamped to [0, 1]."""
    v = np.clip(linear, 0.0, 1.0)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055).astype(linear.dtype)


def srgb_decode(display: Floats) -> Floats:
    """Decode sRGB display values to linear values, the inverse of `srgb_encode`."""
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4).astype(display.dtype)
