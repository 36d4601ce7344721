"""Rotation of the environment: lights are weighted again in the same bake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from picture_edits import BALL, open_exact_picture, rotate_environment
from session_edits import make_look, relative_rmse, run_until_exact
from tiny_scenes import still_life

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process


@pytest.mark.parametrize("degrees", [30.0, -90.0])
def test_a_rotation_is_reweighted_and_rotating_back_restores_the_picture(transfer, degrees):
    picture = open_exact_picture(transfer, BALL + "theta_h")
    before = picture.image()
    look = make_look(transfer, rotate_environment(degrees))
    picture.set_look(look)
    assert picture.next_job().state == "shading"
    np.testing.assert_array_equal(picture.image(), before)  # unchanged until a new one is ready
    turned = run_until_exact(picture).image()
    assert relative_rmse(turned, ref.full_evaluation(transfer, "front", look)) < 1e-6
    assert relative_rmse(turned, before) > 0.1
    picture.set_look(make_look(transfer))
    np.testing.assert_allclose(run_until_exact(picture).image(), before, rtol=1e-5, atol=1e-6)


def test_full_rotations_change_nothing(transfer):
    picture = open_exact_picture(transfer)
    picture.set_look(make_look(transfer, rotate_environment(360.0)))
    assert picture.next_job() is None
    assert picture.advance(None).exact


def test_curves_follow_in_a_rotated_environment(transfer):
    def edit(document):
        rotate_environment(45.0)(document)
        document["materials"]["Ball"]["terms"][1]["params"]["sigma"] = 0.35

    picture = open_exact_picture(transfer)
    picture.set_look(make_look(transfer, rotate_environment(45.0)))
    run_until_exact(picture).prepare(BALL + "theta_h")
    run_until_exact(picture).set_look(make_look(transfer, edit))
    assert picture.next_job() is None
    assert picture.advance(None).exact
    expected = ref.full_evaluation(transfer, "front", make_look(transfer, edit))
    assert relative_rmse(picture.image(), expected) < 1e-5


def test_a_rotated_bake_is_near_a_fresh_bake(tmp_path):
    scene = still_life()
    radiance = scene.environment.radiance
    environment = replace(scene.environment, radiance=np.roll(radiance, -radiance.shape[1] // 4, axis=1))
    other = make_scene("turned", scene.meshes, scene.materials, scene.cameras, environment)
    recipe = Recipe("direct", ("front",), (48, 36), 1000)
    rotated = open_transfer(bake_in_process(METHODS["direct"], scene, recipe, tmp_path / "one.zarr"), Cache(1 << 30))
    two = open_transfer(bake_in_process(METHODS["direct"], other, recipe, tmp_path / "two.zarr"), Cache(1 << 30))
    images = [
        render_image(rotated, "front", make_look(rotated, rotate_environment(degrees))) for degrees in (90.0, 0.0)
    ]
    expected = render_image(two, "front", make_look(two))
    assert relative_rmse(images[0], expected) < 0.003
    assert relative_rmse(images[1], expected) > 0.2
