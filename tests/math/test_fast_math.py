"""Polynomial angles and logarithms equal NumPy within their stated error."""

import numpy as np

from relume.math.fast_math import acos_clamped, azimuth_fraction, fast_log2


def test_the_arc_cosine_equals_numpy_and_clamps():
    x = np.linspace(-0.2, 1.2, 4001).astype(np.float32)
    actual = np.array([acos_clamped(value) for value in x], np.float64)
    np.testing.assert_allclose(actual, np.arccos(np.clip(x.astype(np.float64), 0, 1)), rtol=0, atol=3e-7)


def test_the_azimuth_equals_numpy_in_all_quadrants():
    angle = np.linspace(0, 2 * np.pi, 4001)
    x, y = np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32)
    actual = np.array([azimuth_fraction(*value) for value in zip(x, y, strict=True)], np.float64)
    expected = np.arctan2(y.astype(np.float64), x.astype(np.float64)) / (2 * np.pi)
    apart = (actual - expected + 0.5) % 1 - 0.5
    assert np.abs(apart).max() < 1e-7
    assert actual.min() >= 0
    assert actual.max() <= 1
    assert azimuth_fraction(np.float32(0), np.float32(0)) == 0


def test_the_logarithm_equals_numpy_and_is_exact_for_powers_of_two():
    x = np.concatenate([np.linspace(1, 2, 2001), np.geomspace(1, 1e30, 997)]).astype(np.float32)
    actual = np.array([fast_log2(value) for value in x], np.float64)
    np.testing.assert_allclose(actual, np.log2(x.astype(np.float64)), rtol=2e-7, atol=1e-6)
    assert [fast_log2(np.float32(2.0**k)) for k in range(20)] == list(range(20))
