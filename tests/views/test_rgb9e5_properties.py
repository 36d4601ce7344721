"""Shared-exponent pixels: decoding returns the encoded color to half a step, and encoding again changes no bit."""

from __future__ import annotations

import numpy as np
from for_all import for_all
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from rgb9e5 import RGB9E5_MAX, rgb9e5_unpack

from relume.views.resolve import pack_pixels

F32 = NDArray[np.float32]

RADIANCE = arrays(np.float32, (8, 3), elements=st.floats(0.0, 1e5, width=32))
ANYTHING = arrays(np.float32, (8, 3), elements=st.floats(width=32))
WORDS = arrays(np.uint32, 8, elements=st.integers(0, 2**32 - 1))


@for_all(60, pixels=RADIANCE)
def test_decoded_pixels_differ_by_at_most_half_a_step(pixels: F32) -> None:
    decoded = rgb9e5_unpack(pack_pixels(pixels)).astype(np.float64)
    clamped = np.minimum(pixels, RGB9E5_MAX).astype(np.float64)
    # the step of the largest channel is 2⁻⁸ to 2⁻⁹ of it, once it is rounded; the smallest step is 2⁻²⁴
    largest = clamped.max(axis=1, keepdims=True)
    step = _step(largest + _step(largest) / 2)
    assert (np.abs(decoded - clamped) <= step / 2).all()


def _step(largest: NDArray[np.float64]) -> NDArray[np.float64]:
    _, exponent = np.frexp(largest)
    return np.ldexp(1.0, np.maximum(exponent - 9, -24))


@for_all(60, words=WORDS)
def test_encoding_of_decoded_pixels_is_stable(words: NDArray[np.uint32]) -> None:
    """Several words may mean one color; the encoder chooses the same one for it always."""
    color = rgb9e5_unpack(words)
    canonical = pack_pixels(color)
    np.testing.assert_array_equal(rgb9e5_unpack(canonical), color)
    np.testing.assert_array_equal(pack_pixels(rgb9e5_unpack(canonical)), canonical)


@for_all(60, pixels=ANYTHING)
def test_any_float_is_encoded_as_a_finite_color(pixels: F32) -> None:
    decoded = rgb9e5_unpack(pack_pixels(pixels))
    assert np.isfinite(decoded).all()
    assert decoded.max() <= RGB9E5_MAX
    assert not decoded[~(pixels > 0)].any()  # negative numbers and NaN
    assert (decoded[pixels >= RGB9E5_MAX] == RGB9E5_MAX).all()
