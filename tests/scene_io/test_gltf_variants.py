"""KHR_materials_variants as looks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import DIELECTRIC_TRANSMISSION, Glb
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.scene.model import Scene
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene_io.gltf import import_gltf

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))


def plain(name: str, *color: float, **pbr: Any) -> dict[str, Any]:
    return {"name": name, "pbrMetallicRoughness": {"baseColorFactor": [*color, 1], "metallicFactor": 0, **pbr}}


def with_variants(glb: Glb, materials: list[dict[str, Any]], mappings: list[list[dict[str, Any]]]) -> Glb:
    """A quad for each list of mappings, all with material 0, with the variants "day" and "night"."""
    glb.quad(materials[0])
    primitive = glb.document["meshes"][0]["primitives"][0]
    glb.document["materials"] = materials
    glb.document["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}}
    glb.document["meshes"][0]["primitives"] = [
        primitive | {"extensions": {"KHR_materials_variants": {"mappings": each}}} for each in mappings
    ]
    return glb


def imported(glb: Glb) -> Scene:
    return import_gltf(glb.bytes(), "test", LIGHT)


def test_each_variant_is_a_look_of_its_materials() -> None:
    mappings = [{"material": 0, "variants": [0]}, {"material": 1, "variants": [1]}]
    scene = imported(with_variants(Glb(), [plain("Red", 1, 0, 0), plain("Blue", 0, 0, 1)], [mappings]))
    assert [material.name for material in scene.materials] == ["Red"]
    assert scene.variants["day"] == {"materials": {}}
    terms = scene.variants["night"]["materials"]["Red"]["terms"]
    assert terms[0] == {
        "model": "lambert",
        "color": [0, 0, DIELECTRIC_TRANSMISSION],
        "texture": None,
        "params": {},
        "curves": {},
    }
    assert scene.warnings == ()


def test_meshes_with_different_mappings_get_separate_materials() -> None:
    mappings = [[{"material": 1, "variants": [1]}], []]
    scene = imported(with_variants(Glb(), [plain("Red", 1, 0, 0), plain("Blue", 0, 0, 1)], mappings))
    assert [material.name for material in scene.materials] == ["Red", "Red 2"]
    assert list(scene.variants["night"]["materials"]) == ["Red"]


def test_a_texture_is_kept_if_it_differs_by_a_color_only() -> None:
    glb = Glb()
    info = {"index": glb.texture(np.arange(48).reshape(4, 4, 3) * 5 + 10)}
    red = plain("Red", 1, 0, 0, baseColorTexture=info)
    gold = plain("Gold", 0.5, 0.4, 0.0, baseColorTexture=info)
    gold["pbrMetallicRoughness"]["metallicFactor"] = 1
    scene = imported(with_variants(glb, [red, gold], [[{"material": 1, "variants": [1]}]]))
    lambert, ggx = scene.variants["night"]["materials"]["Red"]["terms"]
    assert lambert["color"] == [0, 0, 0]
    assert ggx["texture"] == "diffuse"
    shown = np.array(ggx["color"]) * ggx["params"]["f0"] * get_texture_values(scene.materials[0].textures["diffuse"])
    expected = np.array([0.5, 0.4, 0.0]) * get_texture_values(scene.materials[0].textures["diffuse"])
    np.testing.assert_allclose(shown, expected, atol=1e-4)  # f0 has a minimum above 0
    assert not any("average color" in warning for warning in scene.warnings)


def test_another_texture_becomes_its_mean_with_a_warning() -> None:
    glb = Glb()
    first, second = glb.texture([[[255, 0, 0], [0, 255, 0]]]), glb.texture([[[255, 255, 255], [0, 0, 0]]])
    red = plain("Red", 1, 1, 1, baseColorTexture={"index": first})
    gray = plain("Grey", 1, 0.5, 1, baseColorTexture={"index": second})
    scene = imported(with_variants(glb, [red, gray], [[{"material": 1, "variants": [0]}]]))
    lambert = scene.variants["day"]["materials"]["Red"]["terms"][0]
    np.testing.assert_allclose(lambert["color"], np.array([0.5, 0.25, 0.5]) * DIELECTRIC_TRANSMISSION, atol=1e-6)
    assert lambert["texture"] is None
    assert any("average color" in warning for warning in scene.warnings)


def test_another_normal_map_is_a_warning() -> None:
    glb = Glb()
    bumpy = plain("Bumpy", 1, 1, 1) | {"normalTexture": {"index": glb.texture([[[200, 128, 255]]])}}
    scene = imported(with_variants(glb, [plain("Red", 1, 0, 0), bumpy], [[{"material": 1, "variants": [0]}]]))
    assert any("normal map" in warning for warning in scene.warnings)


def test_variants_are_stored_with_the_scene(tmp_path) -> None:
    scene = imported(
        with_variants(Glb(), [plain("Red", 1, 0, 0), plain("Blue", 0, 0, 1)], [[{"material": 1, "variants": [1]}]])
    )
    save_scene(scene, tmp_path)
    assert load_scene(tmp_path).variants == scene.variants
    other = imported(Glb().quad(plain("Red", 1, 0, 0)))
    assert other.id != scene.id


@pytest.mark.parametrize(
    "mappings",
    [
        "many",
        [{"material": 9, "variants": [0]}],
        [{"material": -1, "variants": [0]}],
        [{"material": 1, "variants": [0] * 101}],
        [{"material": 1, "variants": [0]}] * 101,
    ],
)
def test_invalid_mappings_are_left_out_with_a_warning(mappings: Any) -> None:
    scene = imported(with_variants(Glb(), [plain("Red", 1, 0, 0), plain("Blue", 0, 0, 1)], [mappings]))
    assert scene.materials[0].name == "Red"
    assert scene.warnings


def test_a_mapping_to_a_missing_variant_changes_nothing() -> None:
    mappings = [[{"material": 1, "variants": [7]}]]
    scene = imported(with_variants(Glb(), [plain("Red", 1, 0, 0), plain("Blue", 0, 0, 1)], mappings))
    assert all(look == {"materials": {}} for look in scene.variants.values())


def test_too_many_variants_are_left_out_with_a_warning() -> None:
    glb = with_variants(Glb(), [plain("Red", 1, 0, 0)], [[]])
    glb.document["extensions"]["KHR_materials_variants"]["variants"] = [{}] * 101
    scene = imported(glb)
    assert not scene.variants
    assert any("variants" in warning for warning in scene.warnings)


def test_a_variant_follows_the_same_roughness_map_or_has_its_mean() -> None:
    glb = Glb()
    own, other = (glb.texture([[[0, low, 0], [0, high, 0]]]) for low, high in ((50, 200), (10, 30)))
    rough = [{"metallicRoughnessTexture": {"index": index}} for index in (own, own, other)]
    materials = [
        plain(name, 1, 1, 1, **parameters) for name, parameters in zip(("own", "same", "smooth"), rough, strict=True)
    ]
    mappings = [[{"material": 1, "variants": [0]}, {"material": 2, "variants": [1]}]]
    scene = imported(with_variants(glb, materials, mappings))
    day, night = (scene.variants[name]["materials"]["own"]["terms"][1] for name in ("day", "night"))
    assert day["roughness_map"] == "roughness"
    assert "roughness_map" not in night
    assert night["params"]["roughness"] == pytest.approx(20 / 255, abs=1e-6)
    assert any("roughness" in warning for warning in scene.warnings)
