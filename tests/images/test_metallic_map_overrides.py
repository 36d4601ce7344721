"""A metallic map divides a material like the import of a file with that map."""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from glb_builder import Glb
from opened_bakes import open_small_bake
from opened_bakes import render_exact as shown_by
from PIL import Image
from session_edits import relative_rmse
from tiny_scenes import corner

from relume.assets.environments.environment import Environment
from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import IMAGES
from relume.core.errors import NotFoundError, ParameterError, SceneError
from relume.images.image_store import get_record, load_texture, store
from relume.images.metalness import with_metalness
from relume.look import default_look, validate
from relume.scene.model import Material
from relume.scene.scene_folder import load_material, save_scene
from relume.scene.texture_encoding import decode
from relume.scene_io.gltf import import_gltf

SIDE = 48
LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
Y, X = np.mgrid[0:SIDE, 0:SIDE]
BASE = np.stack([60 + 4 * X, 250 - 3 * Y, 90 + X + Y], axis=-1).astype(np.uint8)
METAL = np.stack([X, 255 + 0 * X, np.where((X // 12 + Y // 12) % 2, 255, 3 * X)], axis=-1).astype(np.uint8)


def imported(base=None, packed=None, metallic=1.0):
    """A scene of one material with these maps."""
    glb = Glb()
    pbr = {"metallicFactor": metallic, "baseColorFactor": [0.9, 0.8, 0.5, 1], "roughnessFactor": 0.5}
    for key, pixels in {"baseColorTexture": base, "metallicRoughnessTexture": packed}.items():
        if pixels is not None:
            pbr[key] = {"index": glb.texture(pixels)}
    return import_gltf(glb.quad({"name": "Tray", "pbrMetallicRoughness": pbr}).bytes(), "test", LIGHT)


def complete(terms):
    return [complete_term(("terms", k), term, None) for k, term in enumerate(terms)]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    with IMAGES.with_search_folder(tmp_path_factory.mktemp("metal") / "images") as folder:
        yield folder


@pytest.fixture(scope="module")
def uploaded(library, tmp_path_factory):
    """Store an image of these texels and return its record."""
    folder = tmp_path_factory.mktemp("files")

    def keep_pixels(pixels, name):
        Image.fromarray(pixels).save(folder / f"{name}.png")
        return store(library, folder / f"{name}.png", name)

    return keep_pixels


def shown(scene, terms):
    """Diffuse color and normal-incidence reflectance of every texel. (side, side, 3) each"""

    def texels(name):
        texture = scene.materials[0].textures.get(name) if name in ("diffuse", "specular", None) else load_texture(name)
        return 1 if texture is None else decode(texture.pixels, texture.encoding)

    diffuse, ggx = terms
    f0 = np.broadcast_to(ggx["params"]["f0"], 3)
    return diffuse["color"] * texels(diffuse["texture"]), f0 * ggx["color"] * texels(ggx["texture"])


def override(library, scene, terms, image):
    read, reserve = lambda _scene, _name: scene.materials[0], lambda _num_bytes: None
    return with_metalness(library, terms, image.id, scene.id, "Tray", read, reserve)


@pytest.mark.parametrize("base", [BASE, None], ids=["map", "colour"])
def test_an_override_equals_the_import_of_the_map(base, library, uploaded):
    """For a base color from a map, from an override, or from one color: texel by texel."""
    image, expected = uploaded(METAL, "Metal"), imported(base, METAL)
    plain = imported(base, None, metallic=0)
    terms = override(library, plain, complete(plain.materials[0].terms), image)
    actual, wanted = shown(plain, terms), shown(expected, expected.materials[0].terms)
    np.testing.assert_allclose(actual, np.broadcast_arrays(*wanted), atol=3e-6)  # numbers of looks have six digits
    np.testing.assert_allclose(terms[1]["params"]["f0"], expected.materials[0].terms[1]["params"]["f0"], atol=1e-6)
    assert np.std(actual[0]) > 0.1


def test_a_base_color_override_is_preserved(library, uploaded):
    """Also with another metallic map after that."""
    plain, (tint, highlight) = (scene := imported(None, None, metallic=0)), complete(scene.materials[0].terms)
    terms = [{**tint, "texture": uploaded(BASE, "Colour").texture}, highlight]
    for packed, name in ((METAL, "Metal"), (255 - METAL, "Other")):
        terms, expected = override(library, plain, terms, uploaded(packed, name)), imported(BASE, packed)
        np.testing.assert_allclose(shown(plain, terms), shown(expected, expected.materials[0].terms), atol=1e-6)


@pytest.mark.parametrize("base", [BASE, BASE // 8, np.full_like(BASE, 20)], ids=["bright", "dark", "black"])
def test_a_divided_base_color_is_recombined_first(base, library, uploaded):
    """The base color of a material with a metallic map is recovered from its own textures, within 8-bit rounding."""
    was, expected = imported(base, METAL), imported(base, 255 - METAL)
    image = uploaded(255 - METAL, "Other")
    terms = override(library, was, complete(was.materials[0].terms), image)
    actual, wanted = shown(was, terms), shown(expected, expected.materials[0].terms)
    np.testing.assert_allclose(actual, wanted, atol=0.02)
    again = override(library, was, terms, image)
    np.testing.assert_allclose(shown(was, again), actual, atol=1e-6)


def test_a_metal_of_one_color_becomes_diffuse_where_the_map_is_zero(library, uploaded):
    was, expected = imported(metallic=1), imported(None, METAL)
    terms = override(library, was, complete(was.materials[0].terms), uploaded(METAL, "Metal"))
    actual, wanted = shown(was, terms), shown(expected, expected.materials[0].terms)
    np.testing.assert_allclose(actual, wanted, atol=0.003)


@pytest.mark.parametrize("value", [0, 40_000])
def test_a_16_bit_map_of_one_texel_is_metal_everywhere_or_nowhere(value, library, tmp_path):
    Image.fromarray(np.full((1, 1), value, np.uint16)).save(tmp_path / "x.png")
    was, metallic = imported(BASE, metallic=0), value // 257 / 255
    terms = override(library, was, complete(was.materials[0].terms), store(library, tmp_path / "x.png", "x"))
    expected = imported(BASE, metallic=metallic)
    wanted = shown(expected, expected.materials[0].terms)
    np.testing.assert_allclose(shown(was, terms), np.broadcast_arrays(*wanted), atol=0.005)


def test_materials_without_base_color_or_highlight_are_rejected(library, uploaded):
    scene = imported(BASE, metallic=0)
    for term in complete(scene.materials[0].terms):
        with pytest.raises(ParameterError, match=r"lambert.*ggx; add the missing one"):
            override(library, scene, [term], uploaded(METAL, "Metal"))


def test_a_material_is_read_without_the_others(library, tmp_path):
    scene = imported(BASE, METAL)
    save_scene(scene, tmp_path)
    material = load_material(tmp_path, "Tray")
    assert material.terms == scene.materials[0].terms
    np.testing.assert_array_equal(material.textures["diffuse"].pixels, scene.materials[0].textures["diffuse"].pixels)
    with pytest.raises(NotFoundError, match="no material 'Lid'"):
        load_material(tmp_path, "Lid")
    with pytest.raises(SceneError, match="import the scene again"):
        load_material(tmp_path / "x", "Tray")


def test_the_recipe_of_derived_images_is_stored_and_checked(library, uploaded):
    scene, image = imported(BASE, metallic=0), uploaded(METAL, "Metal")
    diffuse, _ = override(library, scene, complete(scene.materials[0].terms), image)
    identity = diffuse["texture"].removeprefix("image:")
    recipe = get_record(library, identity).recipe
    assert (recipe.channel, recipe.metalness, recipe.base, recipe.scene) == (
        "diffuse",
        image.texture,
        "diffuse",
        scene.id,
    )
    assert recipe.images == (image.texture,)
    record = library / identity / "image.json"
    text = record.read_text()
    record.write_text(json.dumps({**json.loads(text), "made_of": {"channel": "diffuse"}}))
    with pytest.raises(SceneError, match="damaged"):
        get_record(library, identity)
    record.write_text(text)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["direct", "gather", "probes"])
def test_pictures_equal_those_of_a_scene_with_the_metallic_map(method, library, uploaded, tmp_path):
    """For every method, with indirect light where the method has it."""
    files = imported(BASE, metallic=0), imported(BASE, METAL)
    wall = Material("Wall", ({"model": "lambert", "color": [0.8, 0.8, 0.8], "texture": None},))
    plain = corner([replace(files[0].materials[0], name="Floor"), wall])
    own = replace(plain, materials=(replace(files[1].materials[0], name="Floor"), wall))
    document = copy.deepcopy(default_look(plain.materials))
    terms = document["materials"]["Floor"]["terms"]
    document["materials"]["Floor"]["terms"] = override(library, plain, complete(terms), uploaded(METAL, "Metal"))
    actual, without, expected = (
        shown_by(open_small_bake(scene, method, tmp_path / name), validate(look, default_look(scene.materials)), method)
        for scene, look, name in (
            (plain, document, "found"),
            (plain, default_look(plain.materials), "without"),
            (own, default_look(own.materials), "own"),
        )
    )
    assert relative_rmse(actual, expected) < (1e-3 if method == "probes" else 1e-5)
    assert relative_rmse(without, expected) > 0.1
