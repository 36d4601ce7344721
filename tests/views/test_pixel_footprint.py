"""Change of normals within a pixel: that of a sphere in the middle, none across an edge."""

from __future__ import annotations

import numpy as np

from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.views.pixel_footprint import pixel_footprint

WIDTH, HEIGHT = 40, 30


def image_of(position, normal):
    normal = (normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32)
    seed = np.arange(len(position), dtype=np.uint32)
    points = SurfacePoints(position.astype(np.float32), normal, any_tangent(normal), seed)
    wo = np.array([0, 0, 10.0]) - position
    return points, (wo / np.linalg.norm(wo, axis=1, keepdims=True)).astype(np.float32)


def grid():
    y, x = np.divmod(np.arange(WIDTH * HEIGHT), WIDTH)
    return 0.02 * (x - WIDTH / 2), 0.02 * (HEIGHT / 2 - y)


def test_normals_of_a_sphere_change_by_the_distance_over_its_radius():
    x, y = grid()
    position = np.column_stack([x, y, np.sqrt(1 - x * x - y * y)])
    footprint = pixel_footprint(np.arange(WIDTH * HEIGHT), WIDTH, *image_of(position, position))
    middle = footprint.reshape(HEIGHT, WIDTH, 2, 2, 3)[HEIGHT // 2, WIDTH // 2]
    np.testing.assert_allclose(middle[0, 0], [0.02, 0, 0], atol=1e-3)
    np.testing.assert_allclose(middle[0, 1], [0, -0.02, 0], atol=1e-3)
    np.testing.assert_allclose(middle[1, 0], [-0.02 / 9, 0, 0], atol=1e-4)


def test_an_edge_is_no_curvature():
    x, y = grid()
    is_left = x < 0
    normal = np.where(is_left[:, None], [0.0, 0, 1], [1.0, 0, 0])
    footprint = pixel_footprint(np.arange(WIDTH * HEIGHT), WIDTH, *image_of(np.column_stack([x, y, 0 * x]), normal))
    np.testing.assert_allclose(footprint[:, 0], 0, atol=1e-7)


def test_samples_of_one_pixel_share_it():
    x, y = grid()
    position = np.column_stack([x, y, np.sqrt(1 - x * x - y * y)])
    pixel = np.arange(WIDTH * HEIGHT)
    single = pixel_footprint(pixel, WIDTH, *image_of(position, position))
    four = np.repeat(pixel, 4)
    shared = pixel_footprint(four, WIDTH, *image_of(position[four], position[four]))
    np.testing.assert_allclose(shared[::4], single / 2, atol=1e-6)


def test_a_view_without_samples_has_none():
    assert pixel_footprint(np.empty(0, np.int64), WIDTH, *image_of(np.empty((0, 3)), np.ones((0, 3)))).shape == (
        0, 2, 2, 3,
    )  # fmt: skip
