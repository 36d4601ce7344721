"""Angles by polynomials are those of NumPy, as near as they say."""

import numpy as np

from relume.basis.arcs import acos_clamped, azimuth_turns


def test_arc_cosine_is_that_of_numpy_and_clamps():
    x = np.linspace(-0.2, 1.2, 4001).astype(np.float32)
    found = np.array([acos_clamped(one) for one in x], np.float64)
    np.testing.assert_allclose(found, np.arccos(np.clip(x.astype(np.float64), 0, 1)), rtol=0, atol=3e-7)


def test_azimuth_is_that_of_numpy_all_round():
    angle = np.linspace(0, 2 * np.pi, 4001)
    x, y = np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32)
    found = np.array([azimuth_turns(*one) for one in zip(x, y, strict=True)], np.float64)
    expected = np.arctan2(y.astype(np.float64), x.astype(np.float64)) / (2 * np.pi)
    apart = (found - expected + 0.5) % 1 - 0.5
    assert np.abs(apart).max() < 1e-7
    assert found.min() >= 0
    assert found.max() <= 1
    assert azimuth_turns(np.float32(0), np.float32(0)) == 0
