"""Light through tinted glass: its color in narrow and in wide lobes, against the reference and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from session_edits import make_look, relative_rmse
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.assets.environments.equirect import texel_directions
from relume.brdf.fresnel import schlick
from relume.camera.spectral_split import TintSplit
from relume.camera.view_samples import sample_view
from relume.core.cache import Cache
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.alpha_filter import PASS_TINT_GROUPS
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.reference.image import reference_image
from relume.scene.model import Glass, Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (24, 16)
CLEAR = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.3, "f0": [0.04] * 3}}
WHITE = Material("White", ({"model": "lambert", "color": [0.8, 0.8, 0.8]},))
POLISHED = Material("Gold", ({"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.12, "f0": [0.9] * 3}},))
GREEN, RED, BLUE = (0.6, 0.95, 0.7), (0.9, 0.2, 0.1), (0.1, 0.2, 0.9)


def pane(name, material, x=(-60, 60), y=4.0):
    """A horizontal rectangle above the floor."""
    (a, b) = x
    return quad(name, [[a, y, 60], [b, y, 60], [b, y, -60], [a, y, -60]], material)


def floor_under(*glass_quads, material, tints, radiance=None):
    """A floor under tinted glass, with the camera between them. material: of the floor"""
    floor = quad("floor", [[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], 0)
    glasses = [Material(f"Glass {k}", (CLEAR,), glass=Glass(tint=tint)) for k, tint in enumerate(tints)]
    radiance = np.ones((32, 64, 3), np.float32) if radiance is None else radiance
    camera = make_camera("front", (0, 3, 4), (0, 0, 0), 0.5)
    return make_tiny_scene(floor, *glass_quads, camera=camera, environment=radiance, materials=[material, *glasses])


def rendered(scene, folder, change=lambda document: None, method="direct"):
    recipe = Recipe(method, ("front",), SIZE, 600, relightable=True)
    store = bake_in_process(METHODS[method], scene, recipe, folder / f"{method}.zarr")
    bake = open_bake(store, Cache(1 << 28))
    look = make_look(bake, change)
    return render_image(bake, "front", look), look


def test_a_polished_metal_below_tinted_glass_shows_the_tint_in_every_pixel(tmp_path):
    scene = floor_under(pane("pane", 1), material=POLISHED, tints=[GREEN])
    picture, _ = rendered(scene, tmp_path)
    of_pixels = (picture / picture.max(axis=2, keepdims=True)).reshape(-1, 3)
    np.testing.assert_allclose(of_pixels, np.tile(np.divide(GREEN, 0.95), (len(of_pixels), 1)), atol=0.02)


def test_reflecting_glass_tints_the_metal_below(tmp_path):
    scene = floor_under(pane("pane", 1), material=POLISHED, tints=[GREEN])
    picture, look = rendered(scene, tmp_path, method="gather")
    expected = reference_image(scene, "front", look, SIZE, 256, reflects=True).mean(axis=(0, 1))
    of_pixels = (picture / picture.max(axis=2, keepdims=True)).reshape(-1, 3)
    np.testing.assert_allclose(of_pixels.mean(axis=0), expected / expected.max(), atol=0.04)
    assert np.ptp(of_pixels, axis=0).max() < 0.1


def test_two_tints_side_by_side_each_show_in_a_polished_metal(tmp_path):
    scene = floor_under(pane("red", 1, (-60, 0)), pane("blue", 2, (0, 60)), material=POLISHED, tints=[RED, BLUE])
    picture, _ = rendered(scene, tmp_path)
    for half, tint in ((picture[:, :9], RED), (picture[:, -9:], BLUE)):
        of_each = half.reshape(-1, 3) / half.max(axis=2).reshape(-1, 1)
        np.testing.assert_allclose(of_each, np.tile(np.divide(tint, 0.9), (len(of_each), 1)), atol=0.05)


def below_two_tints(position, radiance, degrees):
    """Outgoing radiance of a diffuse floor at positions (n, 3): a sum over texels of a rotated environment. (n, 3)"""
    height, width, _ = radiance.shape
    directions = texel_directions(height, width).reshape(-1, 3)
    area = np.repeat(np.sin((np.arange(height) + 0.5) * np.pi / height), width) * 2 * np.pi**2 / (height * width)
    a = np.radians(degrees)
    directions = directions @ np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
    above = directions[:, 1] > 0
    (x, y, _), power = directions[above].T, radiance.reshape(-1, 3)[above] * area[above, None]
    passes = (y * (1 - schlick(y, 0.04)))[:, None] * power
    is_blue = position[:, :1] + (4 - position[:, 1:2]) * x / y > 0
    return 0.8 / np.pi * (~is_blue @ (passes * RED) + is_blue @ (passes * BLUE))


@pytest.mark.parametrize("degrees", [0.0, 180.0])
def test_a_diffuse_floor_below_two_tints_follows_a_rotated_environment(degrees, tmp_path):
    """An environment with one bright side: the light through each glass changes with the rotation."""
    radiance = np.ones((32, 64, 3), np.float32)
    radiance[:, 8:20] *= 12
    scene = floor_under(
        pane("red", 1, (-60, 0)), pane("blue", 2, (0, 60)), material=WHITE, tints=[RED, BLUE], radiance=radiance
    )
    picture, _ = rendered(scene, tmp_path, lambda d: d["environment"].update(rotation=degrees))
    samples = sample_view(scene, build_scene_buffers(scene), "front", SIZE)
    axes = samples.surface.points.position.T
    center = np.stack([np.bincount(samples.pixel, samples.weight * axis) for axis in axes], axis=1)
    expected = below_two_tints(center, radiance, degrees)
    assert relative_rmse(picture.reshape(-1, 3), expected) < 0.04
    np.testing.assert_allclose(picture.mean(axis=(0, 1)), expected.mean(axis=0), rtol=0.03)


def test_light_beside_the_glass_is_not_tinted(tmp_path):
    """Half of the environment is visible through glass, half past it; a narrow lobe sees one of them."""
    scene = floor_under(pane("pane", 1, (-60, 0)), material=POLISHED, tints=[GREEN])
    picture, _ = rendered(scene, tmp_path)
    past = picture[:, -9:].reshape(-1, 3)
    np.testing.assert_allclose(past / past.max(axis=1, keepdims=True), 1, atol=0.01)


def test_split_samples_sum_to_one_sample_and_leave_others_unchanged():
    scene = floor_under(pane("red", 1, (-60, 0)), pane("blue", 2, (0, 60)), material=WHITE, tints=[RED, BLUE])
    samples = sample_view(scene, build_scene_buffers(scene), "front", SIZE)
    whole = np.bincount(samples.pixel, samples.weight, SIZE[0] * SIZE[1])
    np.testing.assert_allclose(whole, 1, atol=1e-6)
    of_pixel = [np.bincount(samples.pixel, samples.throughput[:, c], SIZE[0] * SIZE[1]) for c in range(3)]
    np.testing.assert_allclose(of_pixel, 1, atol=1e-5)  # light without glass in front has full weight
    assert set(np.unique(samples.alpha_sample)) == set(PASS_TINT_GROUPS[:3])


def test_a_sample_is_split_by_its_tints():
    none = [np.nan] * 3
    tints = np.array([[none, none], [GREEN, none], [none, BLUE], [RED, BLUE]], np.float32)
    split = TintSplit(tints, np.array([0, 4]), by_channel=False)
    form = split.weights(slice(0, len(split.row)))
    np.testing.assert_array_equal(split.row, [0, 1, 2, 3, 1, 3, 2, 3])
    np.testing.assert_array_equal(form.alpha_sample, [0, *PASS_TINT_GROUPS[[0, 0, 0, 1, 1, 2, 2]]])
    np.testing.assert_array_equal(form.num_parts, [1, 2, 2, 3, 2, 3, 2, 3])
    red, green, blue = (np.array(tint, np.float32) for tint in (RED, GREEN, BLUE))
    expected = [np.ones(3), 1 - green, 1 - blue, 1 - red, green, red - blue, blue, blue]
    np.testing.assert_allclose(form.channel_weights / form.num_parts[:, None], expected, atol=1e-6)


@pytest.mark.parametrize("material", [POLISHED, WHITE], ids=["polished", "matt"])
def test_an_added_light_behind_tinted_glass_is_tinted(material, tmp_path):
    """Its shadow rays cross glass like those of the bake: it is one light, also for a diffuse floor."""
    scene = floor_under(pane("pane", 1), material=material, tints=[GREEN])

    def lit(document):
        document["lights"]["Lamp"] = {"kind": "point", "position": [0.0, 6.0, -3.0], "emission": [90.0, 90.0, 90.0]}
        document["environment"]["intensity"] = 0.0

    picture, _ = rendered(scene, tmp_path, lit)
    pixels = picture.reshape(-1, 3)
    bright = pixels[pixels.max(axis=1) > 0.1 * pixels.max()]
    assert len(bright) > 3
    of_each = bright / bright.max(axis=1, keepdims=True)
    np.testing.assert_allclose(of_each, np.tile(np.divide(GREEN, 0.95), (len(bright), 1)), atol=0.02)
