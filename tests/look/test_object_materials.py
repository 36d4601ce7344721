"""Materials that a look gives to some objects: their defaults, what is invalid, links, and scenes with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.core.errors import ParameterError
from relume.export.export_document import prepare_export
from relume.look import apply_patch, complete, default_look, validate
from relume.look.object_materials import (
    MAX_OBJECT_MATERIALS,
    ObjectMaterial,
    object_materials_of,
    with_object_materials,
)
from relume.scene.model import Glass, Light, Material

CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
GOLD = {"model": "lambert", "color": [0.8, 0.6, 0.2]}
RED = {"model": "lambert", "color": [0.9, 0.0, 0.0]}
VASE = {"base": "Gold", "objects": ["vase"]}


def scene_of(**gold):
    meshes = [quad("vase", CORNERS, 0), quad("bowl", CORNERS, 0), quad("wall", CORNERS, 1)]
    materials = [Material("Gold", (GOLD,), **gold), Material("Wall", (RED,))]
    camera = make_camera("front", [0, 0, 3], [0, 0, 0], 0.7)
    return make_tiny_scene(*meshes, camera=camera, environment=np.ones((4, 8, 3), np.float32), materials=materials)


def default_of(scene):
    return default_look(scene.materials, scene.lights)


DEFAULT = default_of(scene_of())


def test_object_material_begins_as_its_base():
    document = complete({"materials": {"Vase gold": VASE}}, DEFAULT)
    assert list(document["materials"]) == ["Gold", "Wall", "Vase gold"]
    assert document["materials"]["Vase gold"] == {**DEFAULT["materials"]["Gold"], **VASE}
    assert object_materials_of(validate(document, DEFAULT)) == (ObjectMaterial("Vase gold", "Gold", ("vase",)),)


def test_patches_add_edit_and_remove_an_object_material():
    document = complete({}, DEFAULT)
    added = apply_patch(document, [{"op": "add", "path": "/materials/V", "value": VASE}], DEFAULT)
    color = [{"op": "replace", "path": "/materials/V/terms/0/color", "value": [0, 1, 0]}]
    edited = apply_patch(added, color, DEFAULT)
    assert edited["materials"]["V"]["terms"][0]["color"] == [0, 1, 0]
    assert edited["materials"]["Gold"] is document["materials"]["Gold"]
    assert apply_patch(edited, [{"op": "remove", "path": "/materials/V"}], DEFAULT) == document


@pytest.mark.parametrize(
    ("materials", "pointer"),
    [
        ({"V": {"base": "Silver", "objects": ["vase"]}}, "/materials/V/base"),
        ({"V": {"base": 3, "objects": ["vase"]}}, "/materials/V/base"),
        ({"V": {"base": "Gold"}}, "/materials/V/objects"),
        ({"V": {"base": "Gold", "objects": []}}, "/materials/V/objects"),
        ({"V": {"base": "Gold", "objects": "vase"}}, "/materials/V/objects"),
        ({"V": {"base": "Gold", "objects": [None]}}, "/materials/V/objects/0"),
        ({"V": VASE, "W": {"base": "Gold", "objects": ["bowl", "vase"]}}, "/materials/W/objects/1"),
        ({"V": {**VASE, "color": [1, 1, 1]}}, "/materials/V/color"),
        ({"Gold": {"base": "Wall", "objects": ["wall"]}}, "/materials/Gold/base"),
        ({"V": {"base": "V", "objects": ["vase"]}}, "/materials/V/base"),
        ({"V\n": VASE}, "/materials/V\n"),
        ({"V": {"objects": ["vase"]}}, "/materials"),
        ({f"V{k}": VASE for k in range(MAX_OBJECT_MATERIALS + 1)}, "/materials"),
    ],
)
def test_invalid_object_material_is_rejected_at_its_place(materials, pointer):
    with pytest.raises(ParameterError) as error:
        complete({"materials": materials}, DEFAULT)
    assert error.value.name == pointer


def test_glass_cannot_be_a_base():
    with pytest.raises(ParameterError, match="without glass"):
        complete({"materials": {"V": VASE}}, default_of(scene_of(glass=Glass())))


def test_emissive_surfaces_cannot_be_a_base():
    light = Light("Lamp", {"kind": "mesh", "material": "Gold", "emission": [1.0, 1.0, 1.0]})
    with pytest.raises(ParameterError, match="emits no light"):
        complete({"materials": {"V": VASE}}, default_of(replace(scene_of(), lights=(light,))))


@pytest.mark.parametrize("mode", ["include", "exclude"])
def test_links_of_the_base_material_link_its_object_materials(mode):
    link = {mode: {"materials": ["Gold"]}}
    lights = {"A": {"kind": "point", "link": link, "shadow_link": {mode: {"materials": ["Wall"]}}}}
    look = validate({"materials": {"V": VASE}, "lights": lights, "environment": {"link": link}}, DEFAULT)
    for surfaces in (look.lights["A"].link, look.environment.link):
        assert getattr(surfaces, mode).materials == ("Gold", "V")
    assert getattr(look.lights["A"].shadow_link, mode).materials == ("Wall",)


def test_scene_has_the_object_material_on_its_objects_alone():
    scene = scene_of()
    assigned = with_object_materials(scene, (ObjectMaterial("V", "Gold", ("vase",)),))
    assert [assigned.materials[mesh.material].name for mesh in assigned.meshes] == ["V", "Gold", "Wall"]
    assert replace(assigned.materials[2], name="Gold") == scene.materials[0]
    assert assigned.id.startswith(scene.id)
    assert assigned.id != scene.id


@pytest.mark.parametrize("objects", [("jug",), ("vase", "wall")])
def test_scene_without_the_object_is_an_error_that_lists_those_of_the_base(objects):
    with pytest.raises(ParameterError, match="'bowl', 'vase'"):
        with_object_materials(scene_of(), (ObjectMaterial("V", "Gold", objects),))


def test_export_has_the_object_materials_of_all_looks():
    """A variant without an object material has its base there."""
    scene = scene_of()
    vase = validate({"materials": {"V": {**VASE, "terms": [RED]}}}, DEFAULT)
    shared = validate({"materials": {"B": {"base": "Gold", "objects": ["bowl", "vase"], "terms": [RED]}}}, DEFAULT)
    export = prepare_export(scene, vase, {"both": shared, "plain": validate({}, DEFAULT)})
    names = [export.materials[mesh.material].name for mesh in export.scene.meshes]
    assert names == ["V", "B", "Wall"]

    def colors(materials):
        base_colors = (materials[mesh.material].surface.base_color for mesh in export.scene.meshes)
        return [np.round(color, 3).tolist() for color in base_colors]

    gold, red = (np.round(term["color"], 3).tolist() for term in (GOLD, RED))
    assert colors(export.materials) == [red, gold, red]
    assert colors(export.variants["both"]) == [red, red, red]
    assert colors(export.variants["plain"]) == [gold, gold, red]
