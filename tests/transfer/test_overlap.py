"""The share of a triangle below an angle, against a triangle cut into very many."""

from __future__ import annotations

import numpy as np
import pytest

from relume.transfer.overlap import area_below, overlap_of

FINE = 250


def fine_values(a, b, c, fine=FINE):
    """The linear angle at the middles of fine² congruent triangles."""
    i, j = np.meshgrid(np.arange(fine), np.arange(fine), indexing="ij")
    up = i + j < fine
    down = i + j < fine - 1
    u = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / fine
    v = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / fine
    return np.sort(a + (b - a) * u + (c - a) * v)


def share_below(y, a, b, c):
    """`area_below` as the projector uses it: 0 and 1 outside the corners' range."""
    low, middle, high, rise, fall, rest = overlap_of(*np.float32([a, b, c]))
    y = np.clip(np.float32(y), low, high)
    return float(area_below(y, low, middle, high, rise, fall, rest))


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
    ],
)
def test_share_is_that_of_a_fine_division(corners):
    values = fine_values(*corners)
    for y in np.linspace(min(corners) - 0.5, max(corners) + 0.5, 41):
        dense = np.searchsorted(values, y) / len(values)
        assert share_below(y, *corners) == pytest.approx(dense, abs=2.5 / FINE)


def test_random_triangles_in_any_order_of_corners():
    rng = np.random.default_rng(1)
    for corners in rng.uniform(0, 256, (60, 3)):
        values, y = fine_values(*corners), rng.uniform(corners.min(), corners.max())
        dense = np.searchsorted(values, y) / len(values)
        found = [share_below(y, *corners[order]) for order in ([0, 1, 2], [2, 0, 1], [1, 0, 2], [2, 1, 0])]
        assert found == pytest.approx([dense] * 4, abs=2.5 / FINE)


def test_share_rises_from_none_to_all():
    for corners in np.random.default_rng(2).uniform(0, 64, (100, 3)):
        cuts = np.linspace(corners.min(), corners.max(), 50)
        shares = np.array([share_below(y, *corners) for y in cuts])
        assert shares[0] == pytest.approx(0, abs=1e-5)
        assert shares[-1] == pytest.approx(1, abs=1e-5)
        assert (np.diff(shares) > -1e-5).all()


@pytest.mark.parametrize("value", [0.0, 0.5, 17.25, 255.9])
def test_triangle_at_one_angle_is_all_below_what_is_above_it(value):
    low, _, high, *factors = overlap_of(*np.float32([value] * 3))
    assert np.isfinite(factors).all()
    assert low == high == np.float32(value)
    for corners in ([value] * 3, [value, value, value + 5e-5], [value, value + 5e-5, value + 5e-5]):
        shares = [share_below(y, *corners) for y in (value, value + 2e-5, value + 1e-3)]
        assert np.isfinite(shares).all()
        assert min(shares) >= -1e-5
        assert max(shares) <= 1 + 1e-5


def test_middle_is_the_middle_whatever_the_size_of_the_angles():
    for corners in np.random.default_rng(3).uniform(0, 256, (200, 3)):
        low, middle, high, *_ = overlap_of(*np.float32(corners))
        assert [low, middle, high] == pytest.approx(sorted(corners), abs=1e-4)
