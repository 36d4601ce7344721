"""Color arithmetic against definitions and the bit patterns of the shared-exponent format."""

from __future__ import annotations

import numpy as np
import pytest
from rgb9e5 import RGB9E5_MAX, rgb9e5_pack, rgb9e5_unpack

from relume.core.color import luminance, srgb_decode, srgb_encode


def test_luminance_of_white_is_one_and_keeps_the_type():
    rgb = np.array([[1, 1, 1], [1, 0, 0], [0, 2, 0]], np.float32)
    y = luminance(rgb)
    assert y.dtype == np.float32
    np.testing.assert_allclose(y, [1, 0.2126, 1.4304], rtol=1e-6)


def test_srgb_curve_at_known_values_and_back():
    linear = np.array([-1, 0, 0.0031308, 0.214041, 0.5, 1, 7])
    np.testing.assert_allclose(srgb_encode(linear), [0, 0, 0.04045, 0.5, 0.735357, 1, 1], atol=1e-5)
    x = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(srgb_decode(srgb_encode(x)), x, atol=1e-7)
    assert srgb_encode(np.float32([0.5])).dtype == np.float32


@pytest.mark.parametrize(
    ("rgb", "word"),
    [
        ((0, 0, 0), 0),
        ((1, 1, 1), 256 | 256 << 9 | 256 << 18 | 16 << 27),
        ((1, 0.5, 0), 256 | 128 << 9 | 16 << 27),
        ((0.9999, 0, 0), 256 | 16 << 27),  # rounding up overflows the mantissa
        ((65408, 0, 0), 511 | 31 << 27),
        ((1e30, 1, 0), 511 | 31 << 27),
        ((np.inf, 0, 0), 511 | 31 << 27),
        ((np.nan, -3, 1), 256 << 18 | 16 << 27),
        ((2.0**-24, 0, 0), 1),
        ((1e-30, 0, 0), 0),
    ],
)
def test_shared_exponent_words(rgb, word):
    assert rgb9e5_pack(np.array(rgb, np.float32)) == word


def test_shared_exponent_keeps_nine_bits_of_the_largest_channel():
    rng = np.random.default_rng(2)
    rgb = np.exp(rng.uniform(-9, 11, (2000, 1)) + rng.normal(size=(2000, 3))).astype(np.float32)
    rgb = np.minimum(rgb, np.float32(RGB9E5_MAX))
    packed = rgb9e5_pack(rgb)
    assert packed.dtype == np.uint32
    error = np.abs(rgb9e5_unpack(packed) - rgb)
    assert (error <= rgb.max(axis=-1, keepdims=True) * 2**-9 * 1.001).all()
    np.testing.assert_array_equal(rgb9e5_pack(rgb9e5_unpack(packed)), packed)
