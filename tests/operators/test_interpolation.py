"""Interpolation in place against a sparse matrix product."""

from __future__ import annotations

import numpy as np
from scipy.sparse import random_array

from relume.operators.interpolation import add_interpolated
from relume.operators.linear_operator import tile_layout
from relume.operators.shade import ShadedTerm
from relume.operators.update_kernel import TILE_SAMPLES


def test_the_product_is_added_to_the_image():
    rng = np.random.default_rng(3)
    num_samples, num_rows = 2 * TILE_SAMPLES + 5, 40
    weights = random_array((num_samples, num_rows), density=0.1, format="csr", dtype=np.float32, rng=rng)
    rows, before = rng.random((num_rows, 3), np.float32), rng.random((num_samples, 3), np.float32)
    image = ShadedTerm.from_rows(before).image
    assert image.shape[0] > 1
    add_interpolated(weights, rows, image)
    expected = ShadedTerm.from_rows(before + weights.astype(float) @ rows)
    np.testing.assert_allclose(image, expected.image, rtol=1e-5)
    tiles, lanes = tile_layout(num_samples)
    padding = image.transpose(0, 2, 1).reshape(tiles * lanes, 3)[num_samples:]
    np.testing.assert_array_equal(padding, np.zeros_like(padding))
