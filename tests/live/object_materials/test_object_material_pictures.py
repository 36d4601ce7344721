"""Object materials: pictures equal those of a scene whose objects have these materials from the start."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.live.fixed_camera.picture import Picture, render_exact
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (64, 48)
CAMERA = make_camera("front", [0.0, 1.6, 2.4], [0, 0.3, 0], 0.7)
WHITE = ({"model": "lambert", "color": [0.8, 0.8, 0.8]},)
GOLD = (
    {"model": "lambert", "color": [0.6, 0.4, 0.1]},
    {"model": "blinn_phong", "color": [0.3, 0.2, 0.1], "params": {"exponent": 20.0}},
)
COPPER = (
    {"model": "lambert", "color": [0.7, 0.05, 0.05]},
    {"model": "blinn_phong", "color": [0.1, 0.1, 0.4], "params": {"exponent": 40.0}},
)
VASE = {"base": "Gold", "objects": ["vase"], "terms": list(COPPER)}
POINT = {"kind": "point", "position": [0.5, 1.9, 0.6], "emission": [4.0, 4.0, 4.0]}


def scene_with(vase, gold=GOLD):
    """Two balls on a floor before a wall. vase: material of the left ball. gold: terms of that of the right one"""
    radiance = np.full((32, 64, 3), 0.3, np.float32)
    radiance[6:8, 10:12] = 60
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    wall = quad("wall", [[-2, 0, -0.7], [2, 0, -0.7], [2, 2, -0.7], [-2, 2, -0.7]], 0)
    balls = [sphere("vase", [-0.38, 0.36, 0], 0.35, vase, 24), sphere("bowl", [0.38, 0.36, 0], 0.35, 1, 24)]
    materials = [Material("White", WHITE), Material("Gold", gold)]
    materials += [Material("Copper", COPPER)] if vase == 2 else []
    return make_tiny_scene(floor, wall, *balls, camera=CAMERA, environment=radiance, materials=materials)


def open_bakes(method, folder):
    """Bakes of the scene with one material for both balls, and with one for each."""
    bakes = []
    for vase in (1, 2):
        recipe = Recipe(method, ("front",), SIZE, 200, num_probes=2000)
        scene = scene_with(vase)
        store = bake_in_process(METHODS[method], scene, recipe, folder / f"{vase}.zarr")
        bakes.append((open_bake(store, Cache(1 << 30)), scene))
    return bakes


@pytest.fixture(scope="module", params=["direct", "gather", "probes"])
def bakes(request, tmp_path_factory):
    return open_bakes(request.param, tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="module")
def direct(tmp_path_factory):
    return open_bakes("direct", tmp_path_factory.mktemp("direct"))


def look_of(bake, materials=None, lights=None, **sections):
    document = copy.deepcopy(complete({}, bake.default_look))
    document["materials"].update(materials or {})
    document["lights"].update(lights or {})
    for name, fields in sections.items():
        document[name].update(fields)
    return validate(document, bake.default_look)


def rms(image, expected):
    return float(np.sqrt(np.mean((image - expected) ** 2) / np.mean(expected**2)))


@pytest.mark.parametrize("show", ["direct", "all"])
def test_picture_is_that_of_a_scene_with_the_material(bakes, show):
    (bake, _), (expected_bake, _) = bakes
    settings = {"transport": {"show": show}, "lights": {"A": POINT}}
    before = render_image(bake, "front", look_of(bake, **settings))
    image = render_image(bake, "front", look_of(bake, {"Copper": VASE}, **settings))
    expected = render_image(expected_bake, "front", look_of(expected_bake, **settings))
    assert rms(before, expected) > 0.1
    # bakes of both scenes trace other rays: visibility is predicted from samples that are neighbors by material
    noise = 1e-4 if show == "direct" and bake.method != "probes" else 0.01
    assert rms(image, expected) < noise


def test_object_material_without_edits_changes_nothing(bakes):
    (bake, _), _ = bakes
    unchanged = {"Copper": {"base": "Gold", "objects": ["vase"]}}
    lights = {"A": {**POINT, "link": {"include": {"materials": ["Gold"]}}}}
    before, after = (render_image(bake, "front", look_of(bake, each, lights)) for each in (None, unchanged))
    np.testing.assert_allclose(after, before, rtol=1e-5, atol=1e-6)


def test_assigned_picture_of_a_session_returns_to_the_shared_material(direct):
    (bake, _), _ = direct
    picture = Picture(bake, "front", bake.cache)
    images = []
    for materials in (None, {"Copper": VASE}, None, {"Copper": {**VASE, "objects": ["bowl", "vase"]}}):
        look = look_of(bake, materials)
        picture.check(look)
        picture.set_look(look)
        render_exact(picture, look, lambda share: None, lambda: False)
        images.append(picture.image())
    np.testing.assert_allclose(images[2], images[0], rtol=1e-6)
    np.testing.assert_allclose(images[1], render_image(bake, "front", look_of(bake, {"Copper": VASE})), rtol=1e-6)
    assert min(rms(images[1], images[0]), rms(images[3], images[1])) > 0.05


def test_prepared_control_of_an_object_material_is_edited_live(direct):
    (bake, _), _ = direct
    picture = Picture(bake, "front", bake.cache)
    picture.set_look(look_of(bake, {"Copper": VASE}))
    pointer = "/materials/Copper/terms/1/params/exponent"
    picture.prepare(pointer)
    terms = [COPPER[0], {**COPPER[1], "params": {"exponent": 90.0}}]
    look = look_of(bake, {"Copper": {**VASE, "terms": terms}})
    picture.set_look(look, active_pointer=pointer)
    render_exact(picture, look, lambda share: None, lambda: False)
    np.testing.assert_allclose(picture.image(), render_image(bake, "front", look), rtol=1e-6)


@pytest.mark.parametrize("objects", [["jug"], ["vase", "floor"]])
def test_object_without_the_base_material_is_an_error_and_the_picture_stays(bakes, objects):
    (bake, _), _ = bakes
    with pytest.raises(ParameterError, match="'bowl', 'vase'"):
        render_image(bake, "front", look_of(bake, {"Copper": {**VASE, "objects": objects}}))


def test_reference_has_the_material_on_the_object(direct):
    (bake, scene), (expected_bake, expected_scene) = direct
    looks = look_of(bake, {"Copper": VASE}), look_of(expected_bake)
    image, expected = (
        reference_image(each, "front", look, SIZE, 0) for each, look in zip((scene, expected_scene), looks, strict=True)
    )
    plain = reference_image(scene, "front", look_of(bake), SIZE, 0)
    assert rms(image, expected) < 0.02 < 0.1 < rms(plain, expected)


def test_mirror_cannot_be_a_base(tmp_path):
    chrome = ({"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.02, "f0": 0.9}},)
    recipe = Recipe("direct", ("front",), SIZE, 64)
    bake = open_bake(bake_in_process(METHODS["direct"], scene_with(1, chrome), recipe, tmp_path / "a"), Cache(1 << 28))
    with pytest.raises(ParameterError, match="no mirror in the scene"):
        render_image(bake, "front", look_of(bake, {"Copper": VASE}))
