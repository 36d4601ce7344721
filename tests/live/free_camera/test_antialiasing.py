"""Antialiased edges with a free camera, against images of many times the size."""

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.core.cache import Cache
from relume.live.free_camera.antialiasing import EDGE_SAMPLE_POSITIONS, resolve, samples_per_edge
from relume.live.free_camera.primary_visibility import trace_primary
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0.3, 0.8, 3], [0, 0.5, 0], 0.8)
SIZE = (48, 36)
FINER = 8


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """A black ball before a white wall in uniform light."""
    black, white = (
        Material(name, ({"model": "lambert", "color": [c] * 3},)) for name, c in (("Ball", 0.0), ("Wall", 1.0))
    )
    wall = quad("wall", [[-3, -2, -1], [3, -2, -1], [3, 3, -1], [-3, 3, -1]], 1)
    scene = make_tiny_scene(
        sphere("ball", (0, 0.5, 0), 0.5, 0, num_rings=24), wall, camera=CAMERA, materials=[black, white]
    )
    recipe = Recipe("probes", ("front",), SIZE, 60, num_probes=1500)
    folder = tmp_path_factory.mktemp("edges")
    return open_bake(bake_in_process(METHODS["probes"], scene, recipe, folder / "s.zarr"), Cache(1 << 30))


def picture(opened, scale):
    look_ = validate(complete({}, opened.default_look), opened.default_look)
    size = SIZE[0] * scale, SIZE[1] * scale
    image = render_image(opened, "front", look_, camera_and_size=(CAMERA, size))[..., 0]
    return image.reshape(SIZE[1], scale, SIZE[0], scale).mean(axis=(1, 3))


def coverage(opened):
    """Coverage of each pixel by the ball. (height, width)"""
    size = SIZE[0] * FINER, SIZE[1] * FINER
    face = trace_primary(opened.stored_scene, opened.embree, CAMERA, size).hits.face[: size[0] * size[1]]
    is_ball = (face >= 0) & (opened.stored_scene.face_material[np.maximum(face, 0)] == 0)
    return is_ball.reshape(SIZE[1], FINER, SIZE[0], FINER).mean(axis=(1, 3))


def test_edge_pixels_are_means_over_their_area(opened):
    actual, reference = picture(opened, 1), picture(opened, FINER)
    gbuffer = trace_primary(opened.stored_scene, opened.embree, CAMERA, SIZE)
    is_edge = np.zeros(SIZE[::-1], bool).ravel()
    is_edge[gbuffer.owner] = True
    is_edge = is_edge.reshape(SIZE[::-1])
    assert 0.02 < is_edge.mean() < 0.2
    ball = coverage(opened)
    partly = (ball > 0.2) & (ball < 0.8)
    assert partly.sum() > 10
    assert is_edge[partly].all()
    centers = np.where(ball < 0.5, reference.max(), 0)  # by one ray
    assert np.sqrt(np.mean((actual - reference)[partly] ** 2)) < 0.6 * np.sqrt(
        np.mean((centers - reference)[partly] ** 2)
    )
    np.testing.assert_allclose(actual[~is_edge], reference[~is_edge], atol=0.05 * reference.max())


def test_pixels_within_one_surface_take_one_ray(opened):
    gbuffer = trace_primary(opened.stored_scene, opened.embree, make_camera("near", [2, 2, 1], [2, 2, -1], 0.3), SIZE)
    assert len(gbuffer.owner) == 0
    assert len(gbuffer.directions) == SIZE[0] * SIZE[1]


def test_images_full_of_edges_take_fewer_rays_per_pixel():
    assert samples_per_edge(0, 1000) == samples_per_edge(100, 1000) == len(EDGE_SAMPLE_POSITIONS)
    assert samples_per_edge(250, 1000) == 2
    assert samples_per_edge(900, 1000) == 0


def test_pixels_without_more_rays_are_unchanged():
    values = np.arange(18, dtype=np.float32).reshape(6, 3)
    resolved = resolve(values, np.array([1, 1], np.int32), 4)
    np.testing.assert_array_equal(resolved[[0, 2, 3]], values[[0, 2, 3]])
    np.testing.assert_allclose(resolved[1], values[[1, 4, 5]].mean(axis=0))
    np.testing.assert_array_equal(resolve(values, np.empty(0, np.int32), 6), values)
    np.testing.assert_allclose(resolve(values[:, 0], np.array([3, 3], np.int32), 4)[3], (9 + 12 + 15) / 3)
