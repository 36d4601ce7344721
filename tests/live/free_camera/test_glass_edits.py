"""Edited glass and a free camera: static views are traced with it, and the free-camera image follows its color."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import relative_rmse, run_next_job
from tiny_scenes import make_camera, make_tiny_scene, quad, studio

from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.progressive_picture import ProgressivePicture
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference.image import reference_image
from relume.scene.model import Glass, Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (32, 24)
BEFORE, AFTER = (0.7, 0.9, 0.8), (0.9, 0.3, 0.2)


@pytest.fixture(scope="module")
def scene():
    """A pane before a wall, without reflection."""
    white = Material("White", ({"model": "lambert", "color": [0.8, 0.8, 0.8]},))
    glass = Material("Glass", (), glass=Glass(tint=BEFORE))
    wall = quad("wall", [[-3, -3, -1], [3, -3, -1], [3, 3, -1], [-3, 3, -1]], 0)
    pane = quad("pane", [[-0.8, -0.8, 0.3], [0.8, -0.8, 0.3], [0.8, 0.8, 0.3], [-0.8, 0.8, 0.3]], 1)
    camera = make_camera("front", (0, 0.3, 3), (0, 0, 0), 0.8)
    return make_tiny_scene(wall, pane, camera=camera, environment=studio(), materials=[white, glass])


@pytest.fixture(scope="module")
def bake(scene, tmp_path_factory):
    recipe = Recipe("probes", ("front",), SIZE, 300, num_probes=2000)
    folder = tmp_path_factory.mktemp("glass")
    return open_bake(bake_in_process(METHODS["probes"], scene, recipe, folder / "probes.zarr"), Cache(1 << 30))


def look_with(bake, **glass):
    return validate({"materials": {"Glass": {"glass": glass}}}, bake.default_look)


def finished(picture):
    """The picture after all its jobs."""
    while not (picture.advance(None).exact and picture.next_job() is None):
        run_next_job(picture)
    return picture


def free_camera_image(picture, look):
    picture.set_look(look)
    picture.advance(None)
    return picture.image()


def test_the_free_camera_image_follows_the_color_of_glass(bake):
    picture = FreeCameraPicture(bake, "front")
    before, after = (free_camera_image(picture, look) for look in (look_with(bake), look_with(bake, color=list(AFTER))))
    center = SIZE[1] // 2, SIZE[0] // 2
    np.testing.assert_allclose(after[center] / before[center], np.divide(AFTER, BEFORE), rtol=1e-3)
    np.testing.assert_array_equal(after[0], before[0])  # past the pane
    np.testing.assert_array_equal(free_camera_image(picture, look_with(bake)), before)


def test_a_static_view_previews_a_color_and_is_traced_with_it(bake, scene):
    builder = StaticViewBuilder.from_bake(bake, scene)
    free_picture = FreeCameraPicture(bake, "front", is_watched=True)
    picture = ProgressivePicture(free_picture, builder.make_static_view, bake.cache)
    picture.set_look(look_with(bake))
    picture.set_camera(bake.views["front"].camera, SIZE)
    before = finished(picture).image()
    edited = look_with(bake, color=list(AFTER), ior=1.8)
    picture.set_look(edited)
    assert not picture.advance(None).exact
    run_next_job(picture)
    picture.advance(None)
    preview = picture.image()
    exact = finished(picture).image()
    assert relative_rmse(preview, exact) < 0.4 * relative_rmse(before, exact)  # but for the light on the wall
    expected = reference_image(scene, "front", edited, SIZE, 64, reflects=True)
    assert relative_rmse(exact, expected) < 0.05
    rendered = render_image(bake, "front", edited, static_views=builder)
    np.testing.assert_allclose(rendered, exact, rtol=1e-4, atol=1e-5)
    picture.set_look(look_with(bake))
    np.testing.assert_array_equal(finished(picture).image(), before)
