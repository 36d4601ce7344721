"""Color difference of displayed images: CIEDE2000.

Sharma, Wu and Dalal 2005, The CIEDE2000 Color-Difference Formula [sharma2005]; symbols are theirs. About 1 is just
noticeable between two patches side by side.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import TO_XYZ, srgb_decode
from relume.core.thread_pools import for_ranges

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_WHITE = TO_XYZ.sum(axis=1)
_25_POW_7 = 25.0**7
_ROWS_PER_RANGE = 8  # so that the intermediate values of a range stay in the cache


def color_difference(
    first: Shaped[F32, "height width 3"], second: Shaped[F32, "height width 3"]
) -> Shaped[F64, "height width"]:
    """CIEDE2000 difference ΔE₀₀ of each pixel of two displayed images.

    Args:
        first, second: sRGB display values in [0, 1].
    """
    difference = np.empty(first.shape[:2])

    def compare_rows(start: int, stop: int) -> None:
        linear = (srgb_decode(display[start:stop].astype(np.float64)) for display in (first, second))
        difference[start:stop] = ciede2000(*map(to_lab, linear))

    for_ranges(compare_rows, len(difference), _ROWS_PER_RANGE)
    return difference


def to_lab(linear: Shaped[F64, "*shape 3"]) -> Shaped[F64, "*shape 3"]:
    """CIELAB of linear Rec. 709, not negative; white is (1, 1, 1)."""
    ratio = linear @ TO_XYZ.T / _WHITE
    delta = 6 / 29
    f = np.where(ratio > delta**3, np.cbrt(ratio), ratio / (3 * delta**2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def ciede2000(lab_1: Shaped[F64, "*shape 3"], lab_2: Shaped[F64, "*shape 3"]) -> Shaped[F64, "*shape"]:
    """ΔE₀₀ of CIELAB colors, with unit weights k_L, k_C and k_H."""
    (l_1, a_1, b_1), (l_2, a_2, b_2) = np.moveaxis(lab_1, -1, 0), np.moveaxis(lab_2, -1, 0)
    g = 0.5 * (1 - _saturation((np.hypot(a_1, b_1) + np.hypot(a_2, b_2)) / 2))
    a_1, a_2 = (1 + g) * a_1, (1 + g) * a_2
    c_1, c_2 = np.hypot(a_1, b_1), np.hypot(a_2, b_2)
    h_1, h_2 = np.arctan2(b_1, a_1), np.arctan2(b_2, a_2)
    is_chromatic = c_1 * c_2 > 0
    turn = np.where(is_chromatic, np.remainder(h_2 - h_1 + np.pi, 2 * np.pi) - np.pi, 0.0)  # the short way round
    h = np.degrees(np.where(is_chromatic, h_1 + turn / 2, h_1 + h_2))  # the hue of gray is zero
    lightness_mean, c = (l_1 + l_2) / 2, (c_1 + c_2) / 2
    t = (
        1 - 0.17 * _cos(h - 30) + 0.24 * _cos(2 * h) + 0.32 * _cos(3 * h + 6) - 0.20 * _cos(4 * h - 63)
    )  # fmt: skip
    middle = (lightness_mean - 50) ** 2
    s_l = 1 + 0.015 * middle / np.sqrt(20 + middle)
    lightness, chroma = (l_2 - l_1) / s_l, (c_2 - c_1) / (1 + 0.045 * c)
    hue = 2 * np.sqrt(c_1 * c_2) * np.sin(turn / 2) / (1 + 0.015 * c * t)
    blue = np.exp(-(((np.remainder(h, 360) - 275) / 25) ** 2))
    rotation = -2 * _saturation(c) * np.sin(np.radians(60 * blue))
    return np.asarray(np.sqrt(np.maximum(lightness**2 + chroma**2 + hue**2 + rotation * chroma * hue, 0.0)))


def _saturation(chroma: F64) -> F64:
    power = chroma**7
    return np.asarray(np.sqrt(power / (power + _25_POW_7)))


def _cos(degrees: F64) -> F64:
    return np.asarray(np.cos(np.radians(degrees)))
