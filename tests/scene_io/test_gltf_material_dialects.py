"""Materials of older and newer glTF dialects as the terms that relume has."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import Glb
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.brdf.fresnel import schlick
from relume.core.color import srgb_decode
from relume.scene.model import Material, Scene
from relume.scene_io.gltf import import_gltf
from relume.scene_io.surfaces.to_terms import dielectric_reflectance

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
PLASTIC = {"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0, "roughnessFactor": 0.5}


def imported(extensions: dict[str, Any], glb: Glb | None = None, **material: Any) -> Scene:
    described = {"name": "Thing", "pbrMetallicRoughness": PLASTIC, **material}
    described["extensions"] = {f"KHR_materials_{name}": value for name, value in extensions.items()}
    return import_gltf((glb or Glb()).quad(described).bytes(), "test", LIGHT)


def glossy(glb: Glb | None = None, **values: Any) -> Material:
    scene = imported({"pbrSpecularGlossiness": values}, glb)
    assert scene.warnings == ()
    return scene.materials[0]


def test_specular_glossiness_factors_are_f0_and_one_minus_roughness() -> None:
    specular = [0.5, 0.2, 0.1]
    lambert, ggx = glossy(diffuseFactor=[0.8, 0.4, 0.2, 1], specularFactor=specular, glossinessFactor=0.75).terms
    np.testing.assert_allclose(ggx["params"]["f0"], specular, atol=1e-6)
    assert ggx["color"] == [1, 1, 1]
    assert ggx["params"]["roughness"] == 0.25
    transmitted = 1 - dielectric_reflectance(0.5, 1.0)
    np.testing.assert_allclose(lambert["color"], np.array([0.8, 0.4, 0.2]) * transmitted, atol=1e-6)


def test_specular_glossiness_maps_apply_per_texel() -> None:
    """The left half is plastic, the right half gold, with half the factor of glossiness."""
    glb = Glb()
    diffuse = glb.texture([[[255, 255, 255, 255], [0, 0, 0, 255]]])
    plastic, gold = [56, 56, 56, 255], [255, 226, 155, 102]
    packed = glb.texture([[plastic, gold]])
    material = glossy(
        glb, diffuseTexture={"index": diffuse}, specularGlossinessTexture={"index": packed}, glossinessFactor=0.5
    )
    lambert, ggx = material.terms
    f0 = srgb_decode(np.array([plastic[:3], gold[:3]], np.float32) / 255)
    shown = get_texture_values(material.textures["specular"])[0] * ggx["params"]["f0"] * ggx["color"]
    np.testing.assert_allclose(shown, f0, atol=0.01)
    albedo = get_texture_values(material.textures["diffuse"])[0] * lambert["color"]
    transmitted = 1 - dielectric_reflectance(float(f0[0].max()), 1.0)
    np.testing.assert_allclose(albedo, [[transmitted] * 3, [0, 0, 0]], atol=0.01)
    roughness = get_texture_values(material.textures["roughness"])[0, :, 0] * ggx["params"]["roughness"]
    np.testing.assert_allclose(roughness, [1 - 0.5, 1 - 0.5 * 0.4], atol=0.01)


def test_a_uniform_specular_color_map_reduces_the_diffuse_term_by_its_value() -> None:
    glb = Glb()
    tint = {"index": glb.texture([[[128, 128, 128]]])}
    scene = imported({"ior": {"ior": 0}, "specular": {"specularColorTexture": tint}}, glb)
    lambert, ggx = scene.materials[0].terms
    f0 = float(srgb_decode(np.float32(128 / 255)))
    np.testing.assert_allclose(ggx["params"]["f0"], f0, atol=2e-3)
    expected = np.array(PLASTIC["baseColorFactor"][:3]) * (1 - dielectric_reflectance(f0, 1.0))
    np.testing.assert_allclose(lambert["color"], expected, atol=2e-3)


def test_unlit_materials_are_matte_with_exactly_their_color() -> None:
    scene = imported({"unlit": {}, "clearcoat": {"clearcoatFactor": 1}}, emissiveFactor=[1, 1, 1])
    lambert, ggx = scene.materials[0].terms
    assert lambert["color"] == PLASTIC["baseColorFactor"][:3]
    assert ggx["color"] == [0, 0, 0]
    assert not scene.lights
    (warning,) = scene.warnings
    assert "Unlit" in warning
    assert warning.severity == "unsupported"


def test_a_plain_coat_looks_like_a_clear_coat() -> None:
    clear = imported({"clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1}})
    coat = imported({"coat": {"coatFactor": 0.5, "coatRoughnessFactor": 0.1}})
    assert coat.materials[0].terms == clear.materials[0].terms
    assert coat.warnings == clear.warnings


def test_coats_have_a_color_and_an_index_of_refraction() -> None:
    bare = imported({}).materials[0].terms
    values = {"coatFactor": 0.5, "coatIor": 2.0, "coatColorFactor": [1, 0.5, 0]}
    lambert, highlight, coat = imported({"coat": values}).materials[0].terms
    f0 = 1 / 9
    assert coat["params"]["f0"] == pytest.approx(f0, abs=1e-6)
    for under, plain in ((lambert, bare[0]), (highlight, bare[1])):
        np.testing.assert_allclose(under["color"], np.array(plain["color"]) * [1, 0.75, 0.5], atol=1e-6)
        transmitted = np.array(under["curves"]["theta_o"]["factors"])
        center = np.cos((np.arange(len(transmitted)) + 0.5) * np.pi / 2 / len(transmitted))
        np.testing.assert_allclose(transmitted, 1 - 0.5 * schlick(center, f0), atol=2e-3)


def test_what_a_coat_lacks_is_a_warning() -> None:
    (warning,) = imported({"coat": {"coatFactor": 1, "coatDarkeningFactor": 1}}).warnings
    assert "does not darken" in warning


def test_fuzz_is_a_sheen_scaled_by_its_weight() -> None:
    glb = Glb()
    weight = {"index": glb.texture([[[51, 0, 0]]])}
    values = {"fuzzFactor": 0.5, "fuzzTexture": weight, "fuzzColorFactor": [1, 0.5, 0]}
    scene = imported({"fuzz": values}, glb)
    sheen = scene.materials[0].terms[-1]
    assert sheen["model"] == "sheen"
    np.testing.assert_allclose(sheen["color"], [0.1, 0.05, 0], atol=1e-6)
    assert sheen["params"]["roughness"] == 0.5
    assert len([warning for warning in scene.warnings if "fuzz" in warning]) == 1


@pytest.mark.parametrize(
    ("name", "difference"),
    [
        ("iridescence", "interference"),
        ("diffuse_transmission", "no diffuse light passes"),
        ("dispersion", "all colors alike"),
        ("volume_scatter", "not scattered"),
    ],
)
def test_extensions_without_a_term_say_what_differs(name: str, difference: str) -> None:
    (warning,) = imported({name: {}}).warnings
    assert difference in warning
    assert warning.severity == "unsupported"
