"""Interpolation from selected samples: the nearest by position and normal, in the surrounding pixel blocks."""

from __future__ import annotations

import numpy as np

from relume.views.pixel_blocks import nearest_chosen, one_per_block

STEP, NUM, SOFT = 4, 3, 0.5


def squared_distances(view, material, selected):
    """Squared distances from every sample to every selected one; infinite beyond the searched blocks. (n, selected)"""
    rows = view.rows(material)
    y, x = np.divmod(view.pixel[rows].astype(np.int64), view.width)
    normal = view.surface_points(material).normal.astype(np.float64)
    squared = (10 * STEP) ** 2 * ((normal[:, None] - normal[selected]) ** 2).sum(axis=2)
    for coordinate in (x, y):
        squared += (coordinate[:, None] - coordinate[selected]) ** 2
        squared[abs(coordinate[:, None] // STEP - coordinate[selected] // STEP) > 2] = np.inf
    return squared


def test_samples_use_the_nearest_selected_sample(transfer):
    view = transfer.views["front"]
    for material in range(len(transfer.material_names)):
        selected = one_per_block(view, material, STEP)
        near, weight = nearest_chosen(view, material, selected, STEP, NUM, SOFT)
        squared = squared_distances(view, material, selected)
        expected = 1 / (np.sort(squared, axis=1)[:, : near.shape[1]] + SOFT)
        expected = np.where(expected > 0, expected - 0.999 * expected[:, -1:], 0)
        expected /= expected.sum(axis=1, keepdims=True)
        np.testing.assert_allclose(weight, expected, rtol=1e-3, atol=1e-6)
        taken = np.where(weight > 0, np.take_along_axis(squared, near, axis=1), np.inf)
        np.testing.assert_allclose(taken, np.sort(squared, axis=1)[:, : near.shape[1]], rtol=1e-3, atol=1e-2)
