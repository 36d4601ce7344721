"""Overlap of a triangle with the bands, against a finely subdivided triangle."""

from __future__ import annotations

import numba as nb
import numpy as np
import pytest

from relume.core.simd import NUM
from relume.transport.band_overlap import deposit, mean_over_bands, overlap

FINE = 250
NUM_BANDS = 256


@nb.njit
def deposit_all(overlap, weight, out):
    low, center, high, rise, fall = overlap
    for band in range(0, NUM_BANDS, NUM):
        deposit(out, band, low, center, high, rise, fall, weight[0], weight[1], weight[2])


@nb.njit
def mean_of_all(overlap, bands, decreases, channel):
    low, center, high, rise, fall = overlap
    mean, top = np.float32(0), np.int64(low) - 1
    for band in range(top + 1, np.int64(high) + 1, NUM):
        mean += mean_over_bands(decreases, channel, band, low, center, high, rise, fall)
        top = band + NUM - 1
    return mean + bands[channel, top]


def fractions_of(corners, weight=(1, 1, 1)):
    """A triangle distributed to all bands, with three weights at once. (3, J)"""
    out = np.zeros((3, NUM_BANDS + NUM), np.float32)
    deposit_all(overlap(*np.float32(corners)), np.float32(weight), out)
    assert not out[:, NUM_BANDS:].any()
    return out[:, :NUM_BANDS].astype(float)


def fine_values(a, b, c, fine=FINE):
    """The linear angle at the centers of fine² congruent triangles."""
    i, j = np.meshgrid(np.arange(fine), np.arange(fine), indexing="ij")
    up = i + j < fine
    down = i + j < fine - 1
    u = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / fine
    v = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / fine
    return np.sort(a + (b - a) * u + (c - a) * v)


def fine_below(corners):
    """Fraction below the end of each band. (J,)"""
    values = fine_values(*corners)
    return np.searchsorted(values, np.arange(1, NUM_BANDS + 1)) / len(values)


@pytest.mark.parametrize(
    "corners",
    [
        (0.0, 1.0, 2.0),
        (5.3, 1.1, 9.7),
        (3.0, 3.0, 8.0),
        (3.0, 8.0, 8.0),
        (120.2, 120.9, 120.4),
        (0.0, 255.0, 13.0),
        (7.0, 7.001, 30.0),
        (7.5, 30.2, 30.2),
        (255.0, 256.0, 255.5),
    ],
)
def test_fractions_equal_a_fine_subdivision(corners):
    np.testing.assert_allclose(np.cumsum(fractions_of(corners)[0]), fine_below(corners), atol=2.5 / FINE)


def test_random_triangles_in_any_order_of_corners():
    rng = np.random.default_rng(1)
    for extent in (1, 6, 40, 250):
        for corners in rng.uniform(0, 256 - extent) + rng.uniform(0, extent, (25, 3)):
            fractions = [fractions_of(corners[order])[0] for order in ([0, 1, 2], [2, 0, 1], [1, 0, 2], [2, 1, 0])]
            np.testing.assert_array_equal(fractions, np.broadcast_to(fractions[0], (4, NUM_BANDS)))
            np.testing.assert_allclose(np.cumsum(fractions[0]), fine_below(corners), atol=2.5 / FINE)


def test_fractions_are_not_negative_and_sum_to_one():
    for corners in np.random.default_rng(2).uniform(0, 256, (200, 3)):
        fractions = fractions_of(corners)[0]
        assert fractions.min() > -1e-6
        assert fractions.sum() == pytest.approx(1, abs=1e-6)
        inside = (np.arange(1, NUM_BANDS + 1) > corners.min()) & (np.arange(NUM_BANDS) < corners.max())
        assert not fractions[~inside].any()


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0, 17.25, 128.0, 255.9, 255.99998])
def test_triangle_at_one_angle_lies_in_its_band(value):
    for corners in ([value] * 3, [value, value, value - 5e-5], [value, value - 5e-5, value - 5e-5]):
        fractions = fractions_of(np.maximum(corners, 0))[0]
        assert fractions.min() >= 0
        assert fractions.sum() == pytest.approx(1, abs=1e-6)
        near = [min(int(value), NUM_BANDS - 1), max(int(value) - 1, 0)]
        assert fractions[near].max() == pytest.approx(1, abs=1e-5) or value == int(value)
        assert fractions[sorted(set(near))].sum() == pytest.approx(1, abs=1e-6)


def test_weights_of_three_channels_and_means_equal_the_fractions():
    rng = np.random.default_rng(4)
    for corners in rng.uniform(0, 256, (30, 3)):
        fractions = fractions_of(corners)[0]
        np.testing.assert_allclose(
            fractions_of(corners, (2, 0.5, 0)), [2 * fractions, 0.5 * fractions, 0 * fractions], rtol=1e-6
        )
        bands = np.pad(rng.uniform(0, 1, (3, NUM_BANDS)), ((0, 0), (0, NUM)), mode="edge").astype(np.float32)
        decreases = -np.diff(bands, axis=1, prepend=bands[:, :1])
        for channel in range(3):
            mean = mean_of_all(overlap(*np.float32(corners)), bands, decreases, channel)
            assert mean == pytest.approx(float(bands[channel, :NUM_BANDS] @ fractions), rel=2e-6)


def test_the_center_is_accurate_for_angles_of_any_size():
    for corners in np.random.default_rng(3).uniform(0, 256, (200, 3)):
        low, center, high, *_ = overlap(*np.float32(corners))
        assert [low, center, high] == sorted(np.float32(corners))
