"""Scenes without indirect light: baked quickly, rendered without errors, black where there is no light."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, mesh, sphere

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

WHITE = {"model": "lambert", "color": [0.8, 0.8, 0.8]}
FRONT = make_camera("front", (0, 0, 4), (0, 0, 0), 1.0)
TRIANGLE = mesh("triangle", [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], [[0, 1, 2]], 0)


def transfer_of(scene, folder, size=(16, 16)):
    recipe = Recipe("gather", tuple(camera.name for camera in scene.cameras), size, 60)
    return open_transfer(bake_in_process(METHODS["gather"], scene, recipe, folder / "s.zarr"), Cache(1 << 30))


def picture_of(transfer):
    return render_image(transfer, "front", validate({}, transfer.default_look))


def test_a_closed_room_is_black(tmp_path):
    room = sphere("room", (0, 0, 0), 2.0, 0, inside=True)
    image = picture_of(
        transfer_of(make_tiny_scene(room, camera=make_camera("front", (0, 0, 1), (0, 0, 0), 1.0)), tmp_path)
    )
    np.testing.assert_array_equal(image, 0)


@pytest.mark.parametrize("size", [(16, 16), (16, 40)])
def test_a_single_triangle_reflects_nothing_onto_itself(tmp_path, size):
    transfer = transfer_of(make_tiny_scene(TRIANGLE, camera=FRONT), tmp_path, size)
    assert transfer.store.shape("patches/material") == (0,)
    alone = render_image(transfer, "front", validate({"transport": {"show": "direct"}}, transfer.default_look))
    np.testing.assert_array_equal(picture_of(transfer), alone)


def test_a_view_of_nothing_shows_the_background(tmp_path):
    scene = make_tiny_scene(TRIANGLE, camera=make_camera("front", (0, 0, 4), (0, 0, 9), 1.0))
    image = picture_of(transfer_of(scene, tmp_path))
    assert np.isfinite(image).all()
    assert image.min() > 0


def test_an_object_outside_the_view_can_be_edited(tmp_path):
    """It is behind the camera and lights visible surfaces."""
    behind = sphere("behind", (0, 0, 6), 1.5, 1)
    materials = [Material("Seen", (WHITE,)), Material("Behind", (WHITE,))]
    transfer = transfer_of(make_tiny_scene(TRIANGLE, behind, camera=FRONT, materials=materials), tmp_path)
    picture = Picture(transfer, "front", Cache(1 << 28))
    picture.prepare("/materials/Behind/terms/0/curves/theta_i")
    black = {"materials": {"Behind": {"terms": [{**WHITE, "color": [0.0, 0.0, 0.0]}]}}}
    images = []
    for look in ({}, black):
        picture.set_look(validate(look, transfer.default_look))
        while not picture.advance(None).exact or picture.next_job() is not None:
            if picture.next_job() is not None:
                picture.run_next_job(lambda fraction: None, lambda: False)
        images.append(picture.image())
    assert np.isfinite(images).all()
    assert images[1].sum() < images[0].sum()
