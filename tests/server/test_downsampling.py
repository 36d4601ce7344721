"""Downsampling preserves mean radiance."""

import numpy as np
import pytest

from relume.image_io.downsample import downsample


def test_whole_factors_average_blocks() -> None:
    image = np.random.default_rng(3).random((6, 8, 3), np.float32) * 1000
    expected = image.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    assert np.allclose(downsample(image, (4, 3)), expected, rtol=1e-5)


def test_mean_is_preserved_at_any_size() -> None:
    image = np.random.default_rng(4).random((12, 20, 3), np.float32)
    assert downsample(image, (7, 5)).mean() == pytest.approx(image.mean(), rel=0.02)
    assert downsample(image, (20, 12)) is image
