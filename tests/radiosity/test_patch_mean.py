"""Means of coefficients over patches: the same function of direction, in the frame of the patch."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from relume.math.zernike import basis_functions
from relume.radiosity.patch_mean import mean_coefficients
from relume.transport.outgoing_patch_light import NUM_OUTGOING

PATCHES, POINTS = 7, 4


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def test_means_are_the_same_function_in_the_frame_of_the_patch():
    rng = np.random.default_rng(5)
    normal = np.repeat(unit(rng.normal(size=(PATCHES, 3))), POINTS, axis=0)
    tangent = unit(np.cross(normal, rng.normal(size=normal.shape)))
    of_patch = unit(np.cross(normal[::POINTS], rng.normal(size=(PATCHES, 3))))
    coefficients = rng.normal(size=(PATCHES * POINTS, 3, NUM_OUTGOING))
    points = SimpleNamespace(normal=normal.astype(np.float32), tangent=tangent.astype(np.float32))
    mean = mean_coefficients(of_patch.astype(np.float32), points, coefficients.astype(np.float32))
    for patch in range(PATCHES):
        rows = slice(patch * POINTS, (patch + 1) * POINTS)
        n = normal[patch * POINTS]
        directions = unit(rng.normal(size=(20, 3)) + 2 * n)
        directions *= np.sign(directions @ n)[:, None]
        values = [
            basis_functions(directions @ np.stack([t, np.cross(n, t), n], axis=1))[:, :NUM_OUTGOING] @ c.T
            for t, c in zip(tangent[rows], coefficients[rows], strict=True)
        ]
        t = of_patch[patch]
        basis = basis_functions(directions @ np.stack([t, np.cross(n, t), n], axis=1))[:, :NUM_OUTGOING]
        np.testing.assert_allclose(basis @ mean[patch].T, np.mean(values, axis=0), atol=2e-4)


def test_functions_beyond_the_given_ones_are_zero():
    normal, tangent = np.float32([[0, 0, 1]]), np.float32([[1, 0, 0]])
    points = SimpleNamespace(normal=normal, tangent=tangent)
    mean = mean_coefficients(np.float32([[0, 1, 0]]), points, np.ones((1, 3, 3), np.float32))
    np.testing.assert_allclose(mean[0, 0, :3], [1, 1, -1], atol=1e-6)
    assert not mean[0, :, 3:].any()
