"""Highlight edges one pixel thin, against images of many times the size."""

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, sphere

from relume.core.cache import Cache
from relume.core.color import LUMINANCE
from relume.live.free_camera import highlight_edges
from relume.live.free_camera.highlight_edges import RAY_POSITIONS, find_highlight_edges
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0.3, 0.8, 3], [0, 0.5, 0], 0.8)
SIZE, FINER = (32, 24), 6


def beside(luminance, y, x):
    height, width = luminance.shape
    for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
        if 0 <= v < height and 0 <= u < width:
            yield luminance[v, u]


@pytest.mark.parametrize("fraction", [1.0, 0.05])
def test_highlight_edges_are_the_pixels_with_the_largest_differences(monkeypatch, fraction):
    monkeypatch.setattr(highlight_edges, "_MAX_EDGE_FRACTION", fraction)
    rng = np.random.default_rng(1)
    image = rng.exponential(size=(13, 17, 3)).astype(np.float32) ** 3
    is_asked = rng.random(13 * 17) > 0.2
    luminance = image.astype(np.float64) @ LUMINANCE
    jump = [max(abs(luminance[y, x] - neighbor) for neighbor in beside(luminance, y, x)) for y, x in np.ndindex(13, 17)]
    jump = np.where(is_asked, jump, 0)
    expected = np.flatnonzero(jump > luminance.mean())
    assert 0 < len(expected) < is_asked.sum()
    expected = np.sort(expected[np.argsort(-jump[expected])][: int(fraction * 13 * 17)])
    np.testing.assert_array_equal(find_highlight_edges(image, is_asked), expected)


def test_rays_have_distinct_rows_and_columns():
    assert len(np.unique(RAY_POSITIONS[:, 0])) == len(np.unique(RAY_POSITIONS[:, 1])) == len(RAY_POSITIONS)
    assert ((RAY_POSITIONS > 0) & (RAY_POSITIONS < 1)).all()
    np.testing.assert_allclose(RAY_POSITIONS.mean(axis=0), 0.5)


@pytest.fixture(scope="module")
def shiny(tmp_path_factory):
    """A glossy ball seen toward its horizon, where the reflected environment is narrowest."""
    term = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.25, "f0": 0.9}}
    radiance = np.full((32, 64, 3), 0.05, np.float32)
    radiance[12, ::8] = 60
    ball = sphere("ball", (0, 0.5, 0), 0.5, 0, num_rings=24)
    scene = make_tiny_scene(ball, camera=CAMERA, environment=radiance, materials=[Material("B", (term,))])
    recipe = Recipe("probes", ("front",), SIZE, 60, num_probes=1500)
    folder = tmp_path_factory.mktemp("rims")
    return open_bake(bake_in_process(METHODS["probes"], scene, recipe, folder / "s.zarr"), Cache(1 << 30))


def shown(opened, scale):
    look = validate(complete({}, opened.default_look), opened.default_look)
    image = render_image(opened, "front", look, camera_and_size=(CAMERA, (SIZE[0] * scale, SIZE[1] * scale)))[..., :3]
    return image.reshape(SIZE[1], scale, SIZE[0], scale, 3).mean(axis=(1, 3))


def test_highlight_edges_are_means_over_their_pixels(shiny, monkeypatch):
    actual = shown(shiny, 1)
    monkeypatch.setattr(highlight_edges, "_MAX_EDGE_FRACTION", 0.0)
    without, reference = shown(shiny, 1), shown(shiny, FINER)
    changed = (actual != without).any(axis=2)
    assert 0 < changed.sum() <= 0.02 * changed.size
    difference, was_off = (np.sqrt(np.mean((image[changed] - reference[changed]) ** 2)) for image in (actual, without))
    assert difference < 0.3 * was_off
