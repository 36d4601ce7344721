"""Interpolation between the measured directions of a BTF."""

import numpy as np
import pytest

from relume.assets.btf.direction_rings import (
    UBO_81,
    DirectionGrid,
    directions,
    interpolation_weights,
    interpolation_weights_numpy,
    make_direction_grid,
    ubo_grid,
)
from relume.core.errors import MaterialError


def random_directions(num, seed=3):
    rng = np.random.default_rng(seed)
    z, phi = rng.random(num), rng.uniform(-np.pi, np.pi, num)
    sine = np.sqrt(1 - z**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1)


def of_kernel(rings, w):
    index, weight = np.zeros((len(w), 4), np.int32), np.zeros((len(w), 4), np.float32)
    left = [interpolation_weights(rings, *row.astype(np.float32), index[k], weight[k]) for k, row in enumerate(w)]
    return index, weight, np.array(left)


def dense(index, weight, count):
    out = np.zeros((len(index), count))
    for k in range(4):
        np.add.at(out, (np.arange(len(index)), index[:, k]), weight[:, k])
    return out


TURNED = ((0.0, 1), (30.0, 4), (80.0, 7)), (0.0, 0.25, 0.9)  # rings that start at φ ≠ 0


@pytest.mark.parametrize(("described", "shift"), [(UBO_81, ()), TURNED])
def test_the_kernel_equals_plain_numpy(described, shift):
    rings, w = make_direction_grid(described, shift), random_directions(500)
    index, weight, left = of_kernel(rings, w)
    expected, of_expected, expected_left = interpolation_weights_numpy(rings, w)
    actual = dense(index, weight, rings.num_directions)
    np.testing.assert_allclose(actual, dense(expected, of_expected, rings.num_directions), atol=2e-5)
    np.testing.assert_allclose(left, expected_left, atol=1e-5)


@pytest.mark.parametrize("rings", [ubo_grid(), make_direction_grid(*TURNED)])
def test_a_measured_direction_has_weight_one(rings):
    actual = dense(*interpolation_weights_numpy(rings, directions(rings))[:2], rings.num_directions)
    np.testing.assert_allclose(actual, np.eye(rings.num_directions), atol=1e-6)


@pytest.mark.parametrize("rings", [ubo_grid(), make_direction_grid(*TURNED)])
def test_weights_sum_to_one_and_are_continuous(rings):
    theta = np.radians(np.linspace(1, 89, 60))
    for first, second in ((np.pi - 1e-7, -np.pi + 1e-7), (-1e-7, 1e-7)):
        sides = [
            np.stack([np.sin(theta) * np.cos(p), np.sin(theta) * np.sin(p), np.cos(theta)], 1) for p in (first, second)
        ]
        left_weights, right_weights = (
            dense(*interpolation_weights_numpy(rings, side)[:2], rings.num_directions) for side in sides
        )
        np.testing.assert_allclose(left_weights, right_weights, atol=1e-5)
        np.testing.assert_allclose(left_weights.sum(axis=1), 1, atol=1e-9)
    pole = np.array([[1e-7, 0, 1.0], [0, -1e-7, 1.0], [-1e-7, 1e-7, 1.0]])
    np.testing.assert_allclose(
        dense(*interpolation_weights_numpy(rings, pole)[:2], rings.num_directions)[:, 0], 1, atol=1e-5
    )


def test_values_fall_with_the_cosine_below_the_last_ring():
    rings = ubo_grid()
    theta = np.radians([75.0, 85.0, 90.0])
    w = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    np.testing.assert_allclose(
        interpolation_weights_numpy(rings, w)[2], np.cos(theta) / np.cos(np.radians(75)), atol=1e-6
    )


@pytest.mark.parametrize(
    "described",
    [((0.0, 1),), ((5.0, 1), (30.0, 6)), ((0.0, 2), (30.0, 6)), ((0.0, 1), (30.0, 3)), ((0.0, 1), (90.0, 8)),
     ((0.0, 1), (40.0, 8), (30.0, 8)), ((0.0, 1), (30.0, 500))],
)  # fmt: skip
def test_invalid_rings_are_rejected(described):
    with pytest.raises(MaterialError, match="rings"):
        make_direction_grid(described)


@pytest.mark.parametrize("shift", [(0.0,), (0.0, 1.0), (0.0, -0.1), (0.0, np.nan)])
def test_rotations_that_are_no_fraction_of_a_step_are_rejected(shift):
    with pytest.raises(MaterialError, match="ring shifts"):
        make_direction_grid(((0.0, 1), (30.0, 6)), shift)


def test_rings_have_a_number_of_directions():
    assert isinstance(ubo_grid(), DirectionGrid)
    assert ubo_grid().num_directions == 81
