"""Bakes of cameras with a lens: origins of view samples, images against brute force, plans, scenes on disk."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, studio

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.scene.lens import Lens
from relume.scene.model import Material, Scene
from relume.scene.scene_folder import load_scene, make_scene, save_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

LENS, SIZE = Lens(0.15, 4.0, 5), (24, 16)
RECIPE = Recipe("direct", ("front",), SIZE, 200)
PAPER = Material("Paper", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))
GLOSSY = Material("Glossy", ({"model": "ggx", "color": [0.9, 0.7, 0.5], "params": {"roughness": 0.3}},))


def lens_scene(lens: Lens | None = LENS) -> Scene:
    """A glossy ball in focus, before a wall, behind a card."""
    wall = quad("wall", [[-9, -9, -4], [9, -9, -4], [9, 9, -4], [-9, 9, -4]], 0)
    card = quad("card", [[0.2, -0.5, 2.5], [0.5, -0.5, 2.5], [0.5, 0.5, 2.5], [0.2, 0.5, 2.5]], 0)
    camera = replace(make_camera("front", (0, 0, 4), (0, 0, 0), 0.6), lens=lens)
    ball = sphere("ball", [0, 0, 0], 0.8, 1, 24)
    return make_tiny_scene(wall, card, ball, camera=camera, environment=studio(), materials=[PAPER, GLOSSY])


def test_an_image_is_that_of_brute_force_through_the_lens(tmp_path: Path) -> None:
    scene = lens_scene()
    transfer = open_transfer(bake_in_process(METHODS["direct"], scene, RECIPE, tmp_path / "b.zarr"), Cache(1 << 28))
    view = transfer.views["front"]
    assert view.camera.lens == LENS
    origins = view.ray_origins(view.rows(0)) - (0, 0, 4)
    assert len(origins) == view.rows(0).stop - view.rows(0).start
    np.testing.assert_allclose(origins[:, 2], 0, atol=1e-6)
    assert 0.13 < np.hypot(origins[:, 0], origins[:, 1]).max() <= 0.15 + 1e-6
    look = validate({}, transfer.default_look)
    image, reference = render_image(transfer, "front", look), reference_image(scene, "front", look, SIZE, 0)
    error = np.sqrt(np.mean((image - reference) ** 2) / np.mean(reference**2))
    assert error < 0.02
    sharp = reference_image(lens_scene(None), "front", look, SIZE, 0)
    assert np.sqrt(np.mean((image - sharp) ** 2) / np.mean(sharp**2)) > 5 * error


def test_a_plan_says_what_a_lens_costs() -> None:
    with_lens, without = (METHODS["direct"].plan(lens_scene(lens), RECIPE) for lens in (LENS, None))
    assert with_lens.num_view_samples == 8 * without.num_view_samples
    assert with_lens.store_bytes > 2 * without.store_bytes


def test_a_free_camera_has_no_lens() -> None:
    recipe = replace(RECIPE, method="probes")
    attributes, sharp = (METHODS["probes"].attributes(lens_scene(lens), recipe) for lens in (LENS, None))
    assert attributes["views"] == sharp["views"]
    assert METHODS["probes"].plan(lens_scene(), recipe) == METHODS["probes"].plan(lens_scene(None), recipe)


def test_a_scene_on_disk_keeps_its_lens(tmp_path: Path) -> None:
    scenes = [lens_scene(lens) for lens in (LENS, None)]
    made = [make_scene("s", each.meshes, each.materials, each.cameras, each.environment) for each in scenes]
    assert made[0].id != made[1].id
    save_scene(made[0], tmp_path / "scene")
    assert load_scene(tmp_path / "scene").cameras[0].lens == LENS
