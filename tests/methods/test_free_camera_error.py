"""The measured free-camera error of a bake, against whole images."""

import numpy as np
from session_edits import relative_rmse
from tiny_scenes import make_tiny_scene

from relume import look as looks
from relume.core.cache import Cache
from relume.image_io.color_difference import color_difference
from relume.image_io.tone_mapping import tone_map
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (80, 60)


def baked(scene, folder, num_points):
    recipe = Recipe("probes", ("front",), SIZE, 100, num_probes=num_points)
    return open_bake(bake_in_process(METHODS["probes"], scene, recipe, folder / f"{num_points}.zarr"), Cache(1 << 30))


def error_of_a_whole_image(transfer, scene):
    """Mean color difference and relative RMS error of a large image, whose background is exact."""
    look, view = looks.validate(transfer.default_look, transfer.default_look), transfer.views["front"]
    free_bake = FreeCameraPicture(transfer, "front")
    free_bake.set_look(look)
    free_bake.set_camera(view.camera, SIZE)
    free_bake.advance(None)
    exact = render_image(transfer, "front", look, static_views=StaticViewBuilder(transfer.light_transport, scene))
    displayed = [tone_map(image, look.display.exposure, look.display.tone_map) for image in (free_bake.image(), exact)]
    return color_difference(*displayed).mean(), relative_rmse(free_bake.image(), exact)


def test_a_bake_stores_the_error_of_its_images(corner, tmp_path):
    few, many = (baked(corner, tmp_path, num) for num in (80, 300))
    for transfer in (few, many):
        for error, whole in zip(transfer.free_camera_error, error_of_a_whole_image(transfer, corner), strict=True):
            assert 0 < error.standard_error < 0.5 * error.value
            # a small image also has errors along edges
            assert 0.7 * error.value < whole < 2 * error.value
    for coarse, fine in zip(few.free_camera_error, many.free_camera_error, strict=True):
        assert coarse.value > 1.5 * fine.value


def test_the_error_of_a_black_scene_is_unknown(corner, tmp_path):
    dark = make_tiny_scene(
        *corner.meshes,
        camera=corner.cameras[0],
        environment=np.zeros((16, 32, 3), np.float32),
        materials=corner.materials,
    )
    assert baked(dark, tmp_path, 100).free_camera_error is None
