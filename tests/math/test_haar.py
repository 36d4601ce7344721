"""The Haar transform against its matrix."""

from __future__ import annotations

import numpy as np
import pytest

from relume.math.haar import coefficient_levels, haar, padded_length


def matrix(length):
    """Row j: level l and position in the numbering of `haar`, written out."""
    rows = np.zeros((length, length))
    rows[0] = length**-0.5
    for j in range(1, length):
        level = j.bit_length() - 1
        width, column = length >> level, j - (1 << level)
        rows[j, column * width : column * width + width // 2] = width**-0.5
        rows[j, column * width + width // 2 : (column + 1) * width] = -(width**-0.5)
    return rows


@pytest.mark.parametrize("length", [1, 2, 8, 64])
def test_haar_is_its_matrix_which_is_orthonormal(length):
    values = np.random.default_rng(length).normal(size=(length, 3))
    np.testing.assert_allclose(haar(values), matrix(length) @ values, atol=1e-12)
    np.testing.assert_allclose(matrix(length) @ matrix(length).T, np.eye(length), atol=1e-12)


@pytest.mark.parametrize(("length", "padded"), [(1, 1), (2, 2), (3, 4), (64, 64), (65, 128), (15_998, 16_384)])
def test_values_are_padded_with_zeros_to_a_power_of_two(length, padded):
    values = np.random.default_rng(1).normal(size=length)
    assert padded_length(length) == padded
    np.testing.assert_allclose(haar(values), haar(np.pad(values, (0, padded - length))), atol=1e-12)
    assert np.square(haar(values)).sum() == pytest.approx(np.square(values).sum())


def test_levels_double():
    assert coefficient_levels(16).tolist() == [0, 0, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3]
