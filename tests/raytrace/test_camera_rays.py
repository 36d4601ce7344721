"""Camera rays against NumPy."""

import numpy as np

from relume.raytrace.camera_rays import camera_directions
from relume.scene.examples.catalog import built_in

SIZE = (64, 48)


def test_rays_pass_through_the_image_plane():
    camera, rng = built_in("still_life").cameras[0], np.random.default_rng(5)
    x, y = (rng.uniform(0, side, 500).astype(np.float32) for side in SIZE)
    half = np.tan(camera.yfov / 2)
    position = np.stack(
        [(2 * x / SIZE[0] - 1) * half * SIZE[0] / SIZE[1], (1 - 2 * y / SIZE[1]) * half, -np.ones(500)], 1
    )
    along = position @ camera.to_world[:3, :3].T
    expected = along / np.linalg.norm(along, axis=1, keepdims=True)
    directions = camera_directions(camera, SIZE, x, y)
    assert directions.dtype == np.float32
    np.testing.assert_allclose(directions, expected, atol=2e-7)
