"""Prefiltered maps against weighted sums over all texels."""

from __future__ import annotations

import numpy as np
import pytest

from relume.assets.environments.equirect import lookup, texel_directions, texel_solid_angles
from relume.lights.prefilter import MAX_ROWS, downsampled, prefiltered

HEIGHT = 128


def map_with_bright_region(towards, height=HEIGHT):
    """A dim map with a bright region of about 6° in a direction."""
    d = texel_directions(height, 2 * height).astype(float)
    lobe = np.exp((d @ (np.array(towards) / np.linalg.norm(towards)) - 1) / np.radians(6.0) ** 2)
    return (0.2 + 30 * lobe[..., None] * [1.0, 0.8, 0.5]).astype(np.float32)


@pytest.mark.parametrize("towards", [(0, 1, 0), (-1, 0.1, 0.0), (0.3, -1, 0.1)], ids=["pole", "seam", "near a pole"])
@pytest.mark.parametrize("degrees", [5.0, 25.0])
def test_each_direction_has_the_weighted_mean_around_it(towards, degrees):
    radiance = map_with_bright_region(towards)
    w = texel_directions(HEIGHT, 2 * HEIGHT).reshape(-1, 3).astype(float)
    area = np.repeat(texel_solid_angles(HEIGHT, 2 * HEIGHT), 2 * HEIGHT)
    near = np.array(towards) / np.linalg.norm(towards) + 0.3 * np.random.default_rng(5).normal(size=(40, 3))
    places = near / np.linalg.norm(near, axis=1, keepdims=True)
    weights = np.exp((places @ w.T - 1) / np.radians(degrees) ** 2) * area
    expected = weights @ radiance.reshape(-1, 3) / weights.sum(axis=1, keepdims=True)
    actual = lookup(prefiltered(radiance, degrees), places.astype(np.float32))
    assert np.abs(actual - expected).max() < 0.03 * expected.max()


def test_energy_is_preserved_and_uniform_light_unchanged():
    even = np.full((HEIGHT, 2 * HEIGHT, 3), [1.0, 2.0, 3.0], np.float32)
    for degrees in (2.0, 60.0):
        actual = prefiltered(even, degrees)
        np.testing.assert_allclose(actual, np.broadcast_to([1, 2, 3], actual.shape), rtol=1e-5)
    radiance = map_with_bright_region((0.2, 1, 0.1), 100)
    actual = prefiltered(radiance, 8.0)
    sums = [np.tensordot(texel_solid_angles(*a.shape[:2]), a.sum(axis=1, dtype=float), 1) for a in (radiance, actual)]
    np.testing.assert_allclose(sums[1], sums[0], rtol=1e-3)


def test_large_maps_are_downsampled_with_the_same_energy():
    radiance = map_with_bright_region((0.1, 1, 0.0), 600)
    small = downsampled(radiance)
    assert small.shape == (MAX_ROWS, 2 * MAX_ROWS, 3)
    sums = [np.tensordot(texel_solid_angles(*a.shape[:2]), a.sum(axis=1, dtype=float), 1) for a in (radiance, small)]
    np.testing.assert_allclose(sums[1], sums[0], rtol=1e-5)
    assert downsampled(small) is small or np.array_equal(downsampled(small), small)
