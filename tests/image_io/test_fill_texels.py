"""Missing texels become the mean of valid neighbors."""

from __future__ import annotations

import numpy as np

from relume.image_io import fill_texels
from relume.image_io.fill_texels import fill_from_neighbors


def filled(pixels: np.ndarray) -> np.ndarray:
    values = np.array(pixels, np.float32)[..., None]
    fill_from_neighbors(values, np.isnan(values[..., 0]))
    return values[..., 0]


def test_one_texel_is_the_mean_of_its_eight_neighbors() -> None:
    pixels = np.arange(20.0).reshape(4, 5) ** 2
    around = [pixels[y, x] for y in (0, 1, 2) for x in (1, 2, 3) if (y, x) != (1, 2)]
    expected = pixels.copy()
    expected[1, 2] = np.mean(around)
    pixels[1, 2] = np.nan
    np.testing.assert_allclose(filled(pixels), expected, rtol=1e-6)


def test_at_the_edge_the_valid_ones_count_alone() -> None:
    pixels = np.array([[np.nan, np.nan, 4], [2, 6, 8]])
    np.testing.assert_allclose(filled(pixels), [[4, 5, 4], [2, 6, 8]])


def test_a_block_is_filled_inward_and_far_texels_are_zero(monkeypatch) -> None:
    pixels = np.full((9, 40), 3.0)
    pixels[1:8, 1:8] = np.nan
    np.testing.assert_allclose(filled(pixels), 3)
    monkeypatch.setattr(fill_texels, "MAX_ROUNDS", 2)
    inside = np.zeros((9, 40), bool)
    inside[3:6, 3:6] = True
    np.testing.assert_allclose(filled(pixels), np.where(inside, 0, 3))
    monkeypatch.setattr(fill_texels, "MAX_TEXELS", 48)
    np.testing.assert_allclose(filled(pixels), np.where(np.isnan(pixels), 0, 3))
