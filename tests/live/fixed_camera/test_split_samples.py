"""Highlights smaller than a pixel: their mean over it, in exact images and in edits of other curves."""

from pathlib import Path

import numpy as np
import pytest
from session_edits import BUDGET, make_look, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, sphere

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.strategies.shading import average_split
from relume.live.fixed_camera.view_images import ViewImages
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.operators.shade import shade
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.views.split_pixels import SplitLimits, choose_splits

SIZE, FINER = (32, 24), 10
CAMERA = make_camera("front", (0, 0.3, 3), (0, 0, 0), 0.7)
F0 = "/materials/Ball/terms/0/params/f0"


def opened(folder, size):
    environment = np.full((64, 128, 3), 0.2, np.float32)
    environment[14:16, 40:42] = 4000
    metal = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.06, "f0": 0.9}}
    materials = [Material("Ball", (metal,))]
    ball = sphere("ball", (0, 0, 0), 0.8, 0, num_rings=96)
    scene = make_tiny_scene(ball, camera=CAMERA, environment=environment, materials=materials)
    path = bake_in_process(METHODS["direct"], scene, Recipe("direct", ("front",), size, 400), folder / "s.zarr")
    return open_transfer(path, Cache(1 << 30))


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    return opened(tmp_path_factory.mktemp("coarse"), SIZE)


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    return opened(tmp_path_factory.mktemp("fine"), (FINER * SIZE[0], FINER * SIZE[1]))


def metal(transfer, f0=0.9):
    def edit(document):
        document["materials"]["Ball"]["terms"][0]["params"]["f0"] = f0

    return make_look(transfer, edit)


def averaged(image):
    width, height = SIZE
    return image.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))


def relative_error(image, expected):
    return float(np.linalg.norm(image - expected) / np.linalg.norm(expected))


def test_the_glint_of_a_sun_is_the_mean_over_its_pixels(coarse, fine):
    shown = render_image(coarse, "front", metal(coarse)).astype(float)
    expected = averaged(render_image(fine, "front", metal(fine)).astype(float))
    assert relative_error(shown, expected) < 0.1
    assert shown.sum() == pytest.approx(expected.sum(), rel=0.05)


@pytest.mark.parametrize("is_reopened", [False, True])
def test_an_edit_of_f0_keeps_the_glint(coarse, is_reopened):
    if is_reopened:  # images come from files, and the choice of samples is made anew
        render_image(coarse, "front", metal(coarse))
        coarse = open_transfer(Path(coarse.key), Cache(1 << 30))
    picture = Picture(coarse, "front", Cache(BUDGET), is_watched=True)
    picture.set_look(metal(coarse))
    run_until_exact(picture)
    picture.prepare(F0)
    run_until_exact(picture)
    picture.set_look(metal(coarse, 0.4), active_pointer=F0)
    picture.advance(None)
    expected = render_image(coarse, "front", metal(coarse, 0.4)).astype(float)
    assert relative_error(picture.image(), expected) < 0.02


def test_splits_are_where_neighbors_differ_most():
    pixel, size, limits = np.arange(64 * 48), (64, 48), SplitLimits(9, 100)
    radiance = np.ones((64 * 48, 3), np.float32)
    radiance[10 * 64 + 20] = 500
    rows, side = choose_splits(pixel, size, radiance, limits)
    y, x = np.divmod(rows, 64)
    assert sorted(set(y)) == [9, 10, 11]
    assert sorted(set(x)) == [19, 20, 21]
    assert np.all(side == 8)
    assert len(choose_splits(pixel, size, np.ones_like(radiance), limits)[0]) == 0


def test_points_of_a_pixel_are_shaded_as_exactly_as_its_mean_needs(coarse):
    transfer, look = coarse, metal(coarse)
    images = ViewImages(transfer, "front", Cache(BUDGET))
    images.set_look(look)
    target = next(images.targets())
    lobe, term, bands = target.live.lobe, target.live.term, target.live.target_bands
    lights, receivers = images.incident_light(target.material, images.light, lambda: False, lobe=lobe)
    args = lambda fraction: None, lambda: False
    rows = shade(term, bands, lights, receivers, *args).rows(target.material.num_samples)
    split = images.split_light(target.material, images.light, lobe, lambda: rows, lambda: False)
    exact = split.mean(shade(term, bands, split.lights, split.points, *args).rows(split.points.points.num_points))
    averaged = average_split(rows, term, bands, split, lambda: False)
    assert relative_error(averaged[split.rows], exact) < 2e-3
    assert relative_error(rows[split.rows], exact) > 0.1
    others = np.setdiff1d(np.arange(len(rows)), split.rows)
    np.testing.assert_array_equal(averaged[others], rows[others])
