"""What a bake says that its moving pictures are off by, against whole pictures."""

import numpy as np
from session_edits import relative_rmse
from tiny_scenes import make_tiny_scene

from relume import look as looks
from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.methods.registry import METHODS, open_bake
from relume.methods.static_view import StaticViewBuilder
from relume.output.render_image import render_image
from relume.store import bake_in_process
from relume.store.bake_protocol import Recipe

SIZE = (80, 60)


def baked(scene, folder, num_points):
    recipe = Recipe("probes", ("front",), SIZE, 100, num_probes=num_points)
    return open_bake(bake_in_process(METHODS["probes"], scene, recipe, folder / f"{num_points}.zarr"), Cache(1 << 30))


def off_in_a_whole_picture(transfer, scene):
    look, view = looks.validate(transfer.default_look, transfer.default_look), transfer.views["front"]
    moving = FreeCameraPicture(transfer, "front")
    moving.set_look(look)
    moving.set_camera(view.camera, SIZE)
    moving.advance(None)
    exact = render_image(transfer, "front", look, static_views=StaticViewBuilder(transfer.light_transport, scene))
    return relative_rmse(moving.image(), exact)


def test_a_bake_knows_what_its_pictures_are_off_by(corner, tmp_path):
    few, many = (baked(corner, tmp_path, num) for num in (80, 1500))
    for transfer in (few, many):
        error = transfer.free_camera_error
        assert 0 < error.standard_error < 0.5 * error.value
        # a small picture errs along edges, besides
        assert 0.7 * error.value < off_in_a_whole_picture(transfer, corner) < 2 * error.value
    assert few.free_camera_error.value > 1.5 * many.free_camera_error.value


def test_what_is_dark_is_off_by_nothing_that_is_known(corner, tmp_path):
    dark = make_tiny_scene(
        *corner.meshes,
        camera=corner.cameras[0],
        environment=np.zeros((16, 32, 3), np.float32),
        materials=corner.materials,
    )
    assert baked(dark, tmp_path, 100).free_camera_error is None
