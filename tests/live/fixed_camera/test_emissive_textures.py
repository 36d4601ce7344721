"""Surfaces that emit by an image: visible, and illuminating others from their bright parts."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
import pytest
from session_edits import BUDGET, bake_corner_scene, make_look, relative_rmse, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, mesh, quad

from relume.core.cache import Cache
from relume.core.color import luminance
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.scene.emission import normalize_emission
from relume.scene.model import Light, Material, Texture, TextureEncoding
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = 40, 30


def panel(cuts=16):
    """A wall of many triangles with the unit square as UV coordinates."""
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, cuts + 1), np.linspace(0, 1, cuts + 1)))
    corner = (np.arange(cuts)[:, None] * (cuts + 1) + np.arange(cuts)).ravel()
    lower = np.stack([corner, corner + 1, corner + cuts + 2], axis=1)
    upper = np.stack([corner, corner + cuts + 2, corner + cuts + 1], axis=1)
    positions = np.stack([2 * x - 1, y, np.full_like(x, -1)], axis=1)
    return mesh("panel", positions, np.concatenate([lower, upper]), 1, uvs=np.stack([x, 1 - y], axis=1))


@pytest.fixture(scope="module")
def scene():
    """A floor before a dark panel with an orange and a blue emissive field."""
    pixels = np.zeros((16, 16, 3), np.uint8)
    pixels[4:8, 1:5], pixels[6:14, 11:15] = [255, 120, 20], [20, 80, 200]
    texture = Texture(pixels, encoding=TextureEncoding("srgb"))
    floor = Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))
    wall = Material("Panel", ({"model": "lambert", "color": [0.1, 0.1, 0.1]},), {"emission": texture})
    wall, emission = normalize_emission(wall, np.array([30.0, 30.0, 30.0]), [panel()])
    ground = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    camera, dark = make_camera("front", (0.2, 1.0, 2.4), (0, 0.3, -0.3), 0.8), np.full((4, 8, 3), 1e-3, np.float32)
    made = make_tiny_scene(ground, panel(), camera=camera, environment=dark, materials=[floor, wall])
    light = Light("Panel", {"kind": "mesh", "material": "Panel", "emission": emission.tolist()})
    return type(made)(**{**vars(made), "lights": (light,)})


@pytest.fixture(scope="module")
def transfer(scene, tmp_path_factory):
    return bake_corner_scene(scene, "direct", tmp_path_factory.mktemp("shining"))


@pytest.fixture(scope="module")
def pictures(scene, transfer):
    look = make_look(transfer)
    image = run_until_exact(Picture(transfer, "front", Cache(BUDGET))).image()
    return image, reference_image(scene, "front", look, SIZE, 512), transfer.views["front"].material_ids()


def test_the_emission_image_is_visible(pictures) -> None:
    actual, reference, ids = pictures
    wall = ids == 1
    assert reference[wall].max() > 20 * np.median(reference[wall])
    np.testing.assert_allclose(actual[wall], reference[wall], rtol=0.05, atol=0.01 * reference.max())


def test_bright_parts_illuminate_other_surfaces(pictures) -> None:
    """By triangles, with their brightness: the floor gets the mean color; the reference uses each texel."""
    actual, reference, ids = pictures
    brightness, expected = luminance(actual[ids == 0]), luminance(reference[ids == 0])
    assert relative_rmse(brightness, expected) < 0.05
    np.testing.assert_allclose(actual[ids == 0].sum(axis=0), reference[ids == 0].sum(axis=0), rtol=0.1)


def test_intensity_and_color_of_the_light_multiply_the_image(transfer, pictures) -> None:
    def brighter(document):
        red, green, _ = document["lights"]["Panel"]["emission"]
        document["lights"]["Panel"]["emission"] = [3 * red, green, 0.0]

    picture = run_until_exact(Picture(transfer, "front", Cache(BUDGET)))
    picture.set_look(make_look(transfer, brighter))
    actual, before, wall = run_until_exact(picture).image(), pictures[0], pictures[2] == 1
    inner = wall & np.roll(wall, 1, 0) & np.roll(wall, -1, 0) & np.roll(wall, 1, 1) & np.roll(wall, -1, 1)
    np.testing.assert_allclose(actual[inner][:, :2], before[inner][:, :2] * [3, 1], rtol=2e-2, atol=2e-2)
    assert actual[inner][:, 2].max() < 0.05 * before[inner][:, 2].max()


def test_the_picture_equals_the_numpy_reference(transfer, pictures) -> None:
    assert relative_rmse(pictures[0], ref.full_evaluation(transfer, "front", make_look(transfer))) < 1e-5


def test_a_free_camera_shows_the_emission_image(scene, tmp_path, pictures) -> None:
    recipe = Recipe("probes", ("front",), SIZE, 400, num_probes=2000)
    free_bake = open_bake(bake_in_process(METHODS["probes"], scene, recipe, tmp_path / "probes.zarr"), Cache(1 << 30))
    actual, (_, reference, ids) = render_image(free_bake, "front", make_look(free_bake)), pictures
    inner = (ids == 1) & np.roll(ids == 1, 1, 0) & np.roll(ids == 1, -1, 0) & np.roll(ids == 1, 1, 1)
    inner &= np.roll(ids == 1, -1, 1)
    difference = np.abs(actual - reference)[inner] / reference.max()
    assert np.median(difference) < 0.01  # one ray through the pixel center: edges of fields differ
    assert np.corrcoef(actual[inner].ravel(), reference[inner].ravel())[0, 1] > 0.97
