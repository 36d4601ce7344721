"""An image as a roughness map gives the same pictures as a bake whose scene has that map."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from session_edits import bake_corner_scene, relative_rmse, run_until_exact
from tiny_scenes import corner

from relume.brdf.texture_slots import IMAGES
from relume.core.errors import NotFoundError, ParameterError
from relume.images.image_store import get_record, load_roughness_map, mean_roughness, store
from relume.live.fixed_camera.picture import Picture
from relume.look import default_look, validate
from relume.reference.image import reference_image
from relume.scene.model import Material, Texture, TextureEncoding
from relume.scene.texture_encoding import decode

SIDE = 64


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """The name of an image whose green is smooth in some squares, rough in others; red and blue differ."""
    folder = tmp_path_factory.mktemp("rough")
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    green = np.where((x * 4 // SIDE + y * 4 // SIDE) % 2, 40 + x, 180)
    Image.fromarray(np.stack([255 - x, green, y], axis=-1).astype(np.uint8)).save(folder / "rough.png")
    with IMAGES.with_search_folder(folder / "images") as library:
        yield store(library, folder / "rough.png", "Rough").texture


def bumps():
    """Normals that alternate from texel to texel."""
    lean = np.random.default_rng(3).normal(0, 0.15, (128, 128, 2))
    normals = np.concatenate([lean, np.ones((128, 128, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return Texture(np.round(127.5 * (normals + 1)).astype(np.uint8), encoding=TextureEncoding("normal"))


@pytest.fixture(scope="module")
def plain():
    """A normal-mapped floor and a ball of constant roughness; a glossy wall."""
    shiny = {"model": "ggx", "color": [1.0, 1.0, 1.0], "texture": None, "params": {"roughness": 0.4, "f0": 0.5}}
    floor = {"model": "lambert", "color": [0.2, 0.3, 0.2]}, {**shiny, "roughness_map": "roughness"}
    wall = {**floor[0], "color": [0.8, 0.5, 0.2]}, shiny
    materials = [Material("Floor", floor, {}, bumps()), Material("Wall", wall)]
    return corner(materials)


def with_own(scene, name):
    """The scene whose floor has the map and its mean in its file; with the same id, which seeds random numbers."""
    floor, *others = scene.materials
    diffuse, shiny = floor.terms
    shiny = {**shiny, "params": {**shiny["params"], "roughness": mean_roughness(name)}}
    own = replace(floor, terms=(diffuse, shiny), textures={"roughness": load_roughness_map(name)})
    return replace(scene, materials=(own, *others))


@pytest.fixture(scope="module", params=["direct", pytest.param("gather", marks=pytest.mark.slow)])
def bakes(request, plain, named, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bakes")
    scenes = plain, with_own(plain, named)
    return [bake_corner_scene(scene, request.param, folder / str(k)) for k, scene in enumerate(scenes)]


def rough(scene, follows, roughness, **others):
    """The look whose floor follows a map of this mean."""
    document = copy.deepcopy(default_look(scene.materials))
    document["materials"]["Floor"]["terms"][1]["roughness_map"] = follows
    document["materials"]["Floor"]["terms"][1]["params"]["roughness"] = roughness
    document |= others
    return validate(document, default_look(scene.materials))


def shown(transfer, *looks):
    picture = Picture(transfer, "front", transfer.cache)
    for look in looks:
        picture.set_look(look)
        run_until_exact(picture)
    return picture.image()


def test_pictures_equal_those_of_a_scene_with_the_roughness_map(bakes, plain, named):
    """Also with the slider and a rotated environment. Shadows are traced by blocks of neighbors, and gather rays have
    other seeds where samples are in another order: edges differ by a few thousandths, indirect light by noise.
    """
    bare, baked = bakes
    mean, (max_error, usual) = mean_roughness(named), (4e-3, 1e-5) if bare.method == "direct" else (0.03, 0.01)
    rotated = {"environment": {"map": None, "rotation": 40.0}}
    for roughness, others in ((mean, {}), (0.3, rotated)):
        actual = shown(bare, rough(plain, named, mean), rough(plain, named, roughness, **others))
        expected = shown(baked, rough(plain, "roughness", roughness, **others))
        assert relative_rmse(actual, expected) < max_error
        assert np.median(np.abs(actual - expected) / expected) < usual
        assert relative_rmse(shown(bare, rough(plain, "roughness", roughness, **others)), expected) > 0.05


def test_roughness_levels_equal_the_bake(bakes, plain, named):
    bare, baked = bakes
    picture = Picture(bare, "front", bare.cache)
    picture.set_look(rough(plain, named, 0.4))
    other = Picture(bare, "front", bare.cache)
    other.set_look(rough(plain, named, 0.3))
    view, expected = picture._images.view, baked.views["front"]
    assert other._images.view is view  # pictures with the same map share the sorted view
    np.testing.assert_allclose(view.level_pairs[0], expected.level_pairs[0], rtol=1e-5)
    assert np.all(view.level == expected.level)
    assert len(np.unique(view.level)) > 8


def test_removing_the_roughness_map_restores_the_picture(bakes, plain, named):
    bare, _ = bakes
    before = shown(bare, rough(plain, "roughness", 0.4))
    np.testing.assert_array_equal(shown(bare, rough(plain, named, 0.4), rough(plain, "roughness", 0.4)), before)


def test_the_picture_is_unchanged_until_the_map_is_ready(bakes, plain, named):
    bare, _ = bakes
    picture = Picture(bare, "front", bare.cache)
    picture.set_look(rough(plain, "roughness", 0.4))
    before = run_until_exact(picture).image()
    picture.set_look(rough(plain, named, 0.41))
    advance = picture.advance(None)
    assert advance.complete
    assert not advance.exact
    assert relative_rmse(picture.image(), before) < 0.05  # terms without the map follow at once


def test_references_show_the_roughness_map(plain, named):
    mean, own = mean_roughness(named), with_own(plain, named)
    actual, expected = (
        reference_image(scene, "front", rough(scene, follows, mean), (16, 16), 0)
        for scene, follows in ((plain, named), (own, "roughness"))
    )
    assert relative_rmse(actual, expected) < 1e-3
    assert relative_rmse(reference_image(plain, "front", rough(plain, "roughness", mean), (16, 16), 0), expected) > 0.05


def test_terms_of_a_material_share_one_map(plain, named):
    document = copy.deepcopy(default_look(plain.materials))
    first, shiny = document["materials"]["Floor"]["terms"]
    document["materials"]["Floor"]["terms"] = [first, {**shiny, "roughness_map": named}, shiny]
    with pytest.raises(ParameterError, match=r"terms/2/roughness_map.*change them together"):
        validate(document, default_look(plain.materials))


@pytest.mark.parametrize("follows", ["image:0000000000000000", "image:../x", "map", 3, True])
def test_a_missing_image_is_no_roughness_map(plain, follows):
    with pytest.raises(ParameterError, match=r"terms/1/roughness_map.*image that was uploaded"):
        rough(plain, follows, 0.4)


def test_a_deleted_map_leaves_the_picture_unchanged(bakes, plain, named, tmp_path):
    bare, _ = bakes
    Image.fromarray(np.full((4, 4, 3), 99, np.uint8)).save(tmp_path / "x.png")
    picture = Picture(bare, "front", bare.cache)
    before = run_until_exact(picture).image()
    with IMAGES.with_search_folder(tmp_path / "images") as library:
        record = store(library, tmp_path / "x.png", "x")
        look = rough(plain, record.texture, 0.4)
        IMAGES.remove(library, record.id)
        with pytest.raises(NotFoundError):
            picture.set_look(look)
    np.testing.assert_array_equal(run_until_exact(picture).image(), before)


def test_a_roughness_map_is_listed_with_its_mean(named):
    texture = load_roughness_map(named)
    assert texture.pixels.shape == (SIDE, SIDE, 1)
    assert decode(texture.pixels, texture.encoding).mean() == pytest.approx(1, rel=1e-6)
    assert mean_roughness(named) == pytest.approx(texture.pixels.mean() / 255)


@pytest.mark.parametrize("value", [0, 255])
def test_images_of_one_value_have_no_roughness_levels(value, bakes, plain, tmp_path):
    bare, _ = bakes
    Image.fromarray(np.full((1, 1, 3), value, np.uint8)).save(tmp_path / "x.png")
    with IMAGES.with_search_folder(tmp_path / "images") as library:
        record = store(library, tmp_path / "x.png", "x")
        assert get_record(library, record.id).roughness == value / 255
        picture = Picture(bare, "front", bare.cache)
        picture.set_look(rough(plain, record.texture, 0.4))
        assert np.isfinite(run_until_exact(picture).image()).all()
