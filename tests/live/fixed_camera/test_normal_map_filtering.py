"""Highlights of bumps smaller than a pixel, against many small pixels that resolve every bump."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from session_edits import relative_rmse, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import default_look, validate
from relume.methods.registry import METHODS
from relume.raytrace.shading_normals import mean_normal
from relume.raytrace.texture import MipMap
from relume.reference.image import reference_image
from relume.scene.model import Material, Texture, TextureEncoding
from relume.scene.roughness_levels import levels_of_material, slope_variance
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE, FINER, BLOCK = (24, 16), 8, 4
SLOPES = 0.12


def bumps(side=256):
    """Normals with normally distributed slopes, in bumps of a few texels."""
    slopes = gaussian_filter(np.random.default_rng(7).normal(0, 1, (side, side, 2)), (2, 2, 0), mode="wrap")
    slopes *= SLOPES / slopes.std()
    normals = np.concatenate([-slopes, np.ones((side, side, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return Texture(np.round(127.5 * (normals + 1)).astype(np.uint8), encoding=TextureEncoding("normal"))


@pytest.fixture(scope="module")
def scene():
    """A polished floor of small bumps that reflects a light."""
    shiny = {"model": "ggx", "texture": None, "params": {"roughness": 0.3, "f0": 0.9}, "roughness_map": "roughness"}
    floor = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    radiance = np.full((32, 64, 3), 0.05, np.float32)
    radiance[5:9, 14:19] = 20
    camera = make_camera("front", (0, 1.6, 1.6), (0, 0, 0), 0.3)
    return make_tiny_scene(
        floor, camera=camera, environment=radiance, materials=[Material("Floor", (shiny,), {}, bumps())]
    )


def with_filtering(scene, follows):
    """The scene whose floor is widened by its bumps, or not."""
    floor = scene.materials[0]
    return replace(scene, materials=(replace(floor, terms=({**floor.terms[0], "roughness_map": follows},)),))


def shown(scene, folder):
    folder.mkdir()
    store = bake_in_process(METHODS["direct"], scene, Recipe("direct", ("front",), SIZE, 400), folder / "d.zarr")
    picture = Picture(open_transfer(store, Cache(1 << 28)), "front", Cache(1 << 28))
    run_until_exact(picture)
    return picture.image()


def of_blocks(picture):
    """Means over enough pixels to average all bumps."""
    return picture.reshape(picture.shape[0] // BLOCK, BLOCK, picture.shape[1] // BLOCK, BLOCK, 3).mean(axis=(1, 3))


def test_filtered_highlights_are_as_wide_as_all_bumps(scene, tmp_path):
    fine = with_filtering(scene, None)
    look = validate({}, default_look(fine.materials))
    width, height = SIZE
    many = reference_image(fine, "front", look, (FINER * width, FINER * height), 12)
    expected = of_blocks(many.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3)))
    plain = relative_rmse(of_blocks(shown(fine, tmp_path / "plain")), expected)
    wide = relative_rmse(of_blocks(shown(scene, tmp_path / "wide")), expected)
    assert wide < 0.12
    assert plain > 3 * wide


def test_the_mean_normal_tells_the_variance_of_slopes():
    rng = np.random.default_rng(3)
    slopes = rng.normal(0, 0.05, (200_000, 2))
    normals = np.concatenate([-slopes, np.ones((len(slopes), 1))], axis=1)
    length = np.linalg.norm((normals / np.linalg.norm(normals, axis=1, keepdims=True)).mean(axis=0))
    assert slope_variance(np.array([length], np.float32))[0] == pytest.approx(0.05**2, rel=0.02)


@pytest.mark.parametrize("sides", [[[9, 2], [-0.5, 2]], [[1, 0], [2, 14]], [[6, 0], [0, 6]]])
def test_means_are_over_the_pixel_however_long_it_is(sides):
    """Against the mean of many lookups of single normals; a square as wide as the pixel is long has more variance."""
    texture, num = bumps(), 24
    uv = np.random.default_rng(5).random((200, 2)).astype(np.float32)
    extent = np.tile(np.float32(sides) / 256, (200, 1, 1))
    steps = (np.arange(num) + 0.5) / num - 0.5
    offsets = (steps[:, None, None] * extent[0, 0] + steps[None, :, None] * extent[0, 1]).reshape(-1, 2)
    found = MipMap(texture).sample(
        (uv[:, None] + offsets).reshape(-1, 2).astype(np.float32), np.zeros(200 * num**2, np.float32)
    )
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    expected = found.reshape(200, -1, 3).mean(axis=1)
    mean, length = mean_normal(texture, uv, extent)
    # bumps of a few texels: interpolation in a MIP level flattens them somewhat
    assert np.abs(mean - expected).max() < 0.03
    assert np.mean(1 - length) == pytest.approx(np.mean(1 - np.linalg.norm(expected, axis=1)), rel=0.15)


def test_roughness_levels_cover_the_widening(scene):
    ratios, variances = levels_of_material(scene.materials[0])
    assert ratios == (1.0,)
    assert variances[0] == 0
    assert SLOPES**2 < variances[-1] < 2.5 * SLOPES**2  # some pixels cover steeper bumps than others
    assert levels_of_material(with_filtering(scene, None).materials[0]).pairs == ()
    assert levels_of_material(replace(scene.materials[0], normal_map=None)).pairs == ()
