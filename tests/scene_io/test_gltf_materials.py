"""glTF material extensions as terms, and warnings where they cannot be represented."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import DIELECTRIC_TRANSMISSION, Glb
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.brdf.fresnel import schlick
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.scene.model import Glass, Scene
from relume.scene_io.gltf import import_gltf
from relume.scene_io.surfaces.sheen import sheen_albedo, sheen_attenuation
from relume.scene_io.surfaces.to_terms import dielectric_reflectance

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
PLASTIC = {"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0, "roughnessFactor": 0.5}


def imported(extensions: dict[str, Any], glb: Glb | None = None, **material: Any) -> Scene:
    described = {"name": "Thing", "pbrMetallicRoughness": PLASTIC, **material}
    described["extensions"] = {f"KHR_materials_{name}": value for name, value in extensions.items()}
    scene = import_gltf((glb or Glb()).quad(described).bytes(), "test", LIGHT)
    for term in scene.materials[0].terms:
        for name, value in term.get("params", {}).items():
            parameter = TERMS[term["model"]].parameter(name)
            assert parameter.minimum <= np.min(value) <= np.max(value) <= parameter.maximum
    return scene


def terms_of(extensions: dict[str, Any], **material: Any) -> tuple[dict[str, Any], ...]:
    return imported(extensions, **material).materials[0].terms


@pytest.mark.parametrize(("ior", "f0"), [(1.0, 0.0), (1.33, 0.02005946), (1.5, 0.04), (2.42, 0.172394), (0.0, 1.0)])
def test_ior_gives_the_reflectance_at_normal_incidence(ior: float, f0: float) -> None:
    ggx = terms_of({"ior": {"ior": ior}})[1]
    np.testing.assert_allclose(ggx["params"]["f0"], f0, atol=1e-6)


@pytest.mark.parametrize(("f0", "f90"), [(0.04, 1.0), (0.17, 1.0), (0.02, 0.5), (0.0, 0.0)])
def test_the_diffuse_term_gets_the_transmitted_light(f0: float, f90: float) -> None:
    """The mean of F(θd) over light and view directions, both cosine-weighted."""
    rng = np.random.default_rng(7)
    square, turn = rng.random((2, 400_000)), rng.uniform(0, 2 * np.pi, 400_000)
    cosine, sine = np.sqrt(square), np.sqrt(1 - square)
    towards = cosine[0] * cosine[1] + sine[0] * sine[1] * np.cos(turn)
    reflected = f0 + (f90 - f0) * (1 - np.sqrt((1 + towards) / 2)) ** 5
    assert dielectric_reflectance(f0, f90) == pytest.approx(reflected.mean(), abs=1e-4)
    if (f0, f90) == (0.04, 1.0):
        assert dielectric_reflectance(f0, f90) == pytest.approx(1 - DIELECTRIC_TRANSMISSION, abs=1e-6)


def test_specular_gives_both_ends_of_the_fresnel_curve() -> None:
    tint = [0.5, 1.0, 100.0]
    ggx = terms_of({"ior": {"ior": 2.0}, "specular": {"specularFactor": 0.4, "specularColorFactor": tint}})[1]
    cos_theta_d = np.linspace(0, 1, 5)
    for channel, wanted in enumerate([0.5 / 9, 1 / 9, 1.0]):
        expected = 0.4 * schlick(cos_theta_d, wanted)
        actual = ggx["color"][channel] * schlick(cos_theta_d, ggx["params"]["f0"][channel])
        np.testing.assert_allclose(actual, expected, atol=1e-6)


def test_metals_ignore_dielectric_parameters() -> None:
    metal = {"pbrMetallicRoughness": PLASTIC | {"metallicFactor": 1}}
    plain = terms_of({}, **metal)
    assert terms_of({"ior": {"ior": 1.1}, "specular": {"specularFactor": 0.1}}, **metal) == plain


def test_specular_textures_scale_the_reflectance() -> None:
    glb = Glb()
    weight = glb.texture([[[255, 255, 255, 0], [255, 255, 255, 255]]])
    scene = imported({"specular": {"specularTexture": {"index": weight}}}, glb)
    ggx, texture = scene.materials[0].terms[1], scene.materials[0].textures["specular"]
    head_on = np.array(ggx["color"]) * np.array(ggx["params"]["f0"]) * get_texture_values(texture)[0]
    np.testing.assert_allclose(head_on, [[0] * 3, [0.04] * 3], atol=1e-6)


def test_a_coat_is_a_second_highlight_that_attenuates_the_base() -> None:
    bare = terms_of({})
    lambert, below, coat = terms_of({"clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1}})
    assert coat["model"] == "ggx"
    assert coat["color"] == [0.5, 0.5, 0.5]
    assert coat["params"] == {"roughness": 0.1, "f0": 0.04}
    for under, plain in ((lambert, bare[0]), (below, bare[1])):
        assert under["color"] == plain["color"]
        transmitted = np.array(under["curves"]["theta_o"]["factors"])
        center = np.cos((np.arange(len(transmitted)) + 0.5) * np.pi / 2 / len(transmitted))
        np.testing.assert_allclose(transmitted, 1 - 0.5 * schlick(center, 0.04), atol=2e-3)


def test_anisotropy_stretches_along_the_rotated_tangent() -> None:
    scene = imported({"anisotropy": {"anisotropyStrength": 0.6, "anisotropyRotation": np.pi / 2}})
    highlight = scene.materials[0].terms[1]
    across = 0.25
    along = across + (1 - across) * 0.36
    assert highlight["model"] == "ashikhmin_shirley"
    assert highlight["params"]["nv"] == pytest.approx(2 / across**2 - 2)
    assert highlight["params"]["nu"] == pytest.approx(2 / along**2 - 2)
    # u runs along +X; 90° toward the bitangent, up
    np.testing.assert_allclose(scene.meshes[0].tangents, [[0, 1, 0, 1]] * 4, atol=1e-6)
    assert any("Ashikhmin" in warning for warning in scene.warnings)


@pytest.mark.parametrize(
    ("is_bumpy", "has_own", "message"),
    [
        (False, True, "is smooth; in the file it has its own normal map."),
        (True, True, "follows the base normal map; in the file it has its own normal map."),
        (True, False, "follows the base normal map; in the file it is smooth."),
        (False, False, None),
    ],
)
def test_a_coat_with_another_normal_map_gives_a_warning(is_bumpy, has_own, message) -> None:
    glb = Glb()
    bumps = {"index": glb.texture([[[200, 150, 220]]])}
    coat = {"clearcoatFactor": 1} | ({"clearcoatNormalTexture": bumps} if has_own else {})
    scene = imported({"clearcoat": coat}, glb, **({"normalTexture": bumps} if is_bumpy else {}))
    messages = [str(warning) for warning in scene.warnings if "Clearcoat" in str(warning)]
    assert len(messages) == (message is not None)
    assert all(message in warning for warning in messages)


def test_a_rotated_normal_map_gives_the_same_directions() -> None:
    glb = Glb()
    info = {"index": glb.texture([[[200, 150, 220]]])}
    scene = imported({"anisotropy": {"anisotropyStrength": 1, "anisotropyRotation": 0.7}}, glb, normalTexture=info)
    plain = imported({}, (other := Glb()), normalTexture={"index": other.texture([[[200, 150, 220]]])})

    def in_world(scene: Scene) -> np.ndarray:
        assert scene.materials[0].normal_map is not None
        x, y, z = get_texture_values(scene.materials[0].normal_map)[0, 0]
        tangent, normal = scene.meshes[0].tangents[0, :3], scene.meshes[0].normals[0]
        return x * tangent + y * np.cross(normal, tangent) * scene.meshes[0].tangents[0, 3] + z * normal

    np.testing.assert_allclose(in_world(scene), in_world(plain), atol=1e-6)


def test_anisotropy_of_varying_direction_is_a_round_highlight() -> None:
    glb = Glb()
    index = glb.texture([[[255, 128, 255], [0, 128, 255]]])
    scene = imported({"anisotropy": {"anisotropyStrength": 1, "anisotropyTexture": {"index": index}}}, glb)
    assert scene.materials[0].terms[1]["model"] == "ggx"
    assert any("no main direction" in warning for warning in scene.warnings)


def test_sheen_is_a_term_that_attenuates_the_base() -> None:
    extensions = {"sheen": {"sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": 0.5}}
    scene = imported(extensions | {"clearcoat": {"clearcoatFactor": 1}})
    lambert, _, sheen, _ = scene.materials[0].terms
    assert (sheen["model"], sheen["color"], sheen["params"]) == ("sheen", [1, 0.5, 0], {"roughness": 0.5})
    assert lambert["curves"]["theta_o"]["factors"][-1] < 0.5  # attenuated by sheen and coat
    for number, term in enumerate(scene.materials[0].terms):
        complete_term((number,), term, None)  # raises if a look cannot represent it


@pytest.mark.parametrize("theta_o", [0.35, 0.9, 1.3])
def test_sheen_attenuates_the_base_by_the_specification(theta_o: float) -> None:
    """min(1 − E(θi), 1 − E(θo)): within 0.1 % for uniform light, approximate for light from any direction."""
    theta = (np.arange(300) + 0.5) * np.pi / 600
    transmitted = 1 - sheen_albedo(theta, 0.8)
    expected, weights = np.minimum(transmitted, np.interp(theta_o, theta, transmitted)), np.sin(theta) * np.cos(theta)
    light, view = sheen_attenuation(1.0, 0.8, by_light=True)
    shown = light(theta) * view(np.array(theta_o))
    assert shown @ weights == pytest.approx(expected @ weights, rel=1e-3)
    error = np.sqrt((shown - expected) ** 2 @ weights / (expected**2 @ weights))
    assert error < 0.12  # with the view angle alone it is 0.18 for large angles, and 0.15 for small ones
    by_view = sheen_attenuation(1.0, 0.8, by_light=False)[1](np.array(theta_o))
    assert by_view * weights.sum() == pytest.approx(expected @ weights, rel=1e-3)


@pytest.mark.parametrize(
    "extensions",
    [
        {"ior": {"ior": -1}},
        {"specular": {"specularColorFactor": [1]}},
        {"clearcoat": {"clearcoatFactor": "much"}},
        {"sheen": [1]},
    ],
)
def test_invalid_parameters_give_a_warning_and_are_ignored(extensions: dict[str, Any]) -> None:
    scene = imported(extensions)
    assert scene.materials[0].terms == terms_of({})
    assert len(scene.warnings) == 1
    assert scene.warnings[0].severity == "unsupported"


def glass_of(extensions: dict[str, Any], **material: Any) -> Glass:
    glass = imported(extensions, **material).materials[0].glass
    assert glass is not None
    return glass


def test_transmission_is_thin_glass_and_reduces_the_diffuse_term() -> None:
    scene = imported(
        {"transmission": {"transmissionFactor": 0.75}}, pbrMetallicRoughness=PLASTIC | {"roughnessFactor": 0}
    )
    made = scene.materials[0]
    assert made.glass == Glass((0.375, 0.1875, 0.09375))
    np.testing.assert_allclose(
        made.terms[0]["color"], np.array([0.125, 0.0625, 0.03125]) * DIELECTRIC_TRANSMISSION, atol=1e-6
    )
    assert scene.warnings == ()
    assert imported({"transmission": {}}).materials[0].glass is None


def test_a_volume_is_absorbing_solid_glass() -> None:
    volume = {"thicknessFactor": 0.2, "attenuationDistance": 0.5, "attenuationColor": [1, 0.5, 0.25]}
    glass = glass_of({"transmission": {"transmissionFactor": 1}, "volume": volume, "ior": {"ior": 1.33}})
    assert (glass.thickness, glass.ior) == (0.2, 1.33)
    np.testing.assert_allclose(np.exp(-np.array(glass.absorbed) * 0.5), [1, 0.5, 0.25])
    black = glass_of({"transmission": {"transmissionFactor": 1}, "volume": volume | {"attenuationColor": [0, 0, 0]}})
    assert np.isfinite(black.absorbed).all()
    flat = glass_of({"transmission": {"transmissionFactor": 1}, "volume": volume | {"thicknessFactor": 0}})
    assert (flat.thickness, flat.absorbed) == (0.0, (0.0, 0.0, 0.0))


@pytest.mark.parametrize("ior", [0.0, 0.5, 100.0])
def test_an_invalid_index_of_glass_is_replaced_with_a_warning(ior: float) -> None:
    scene = imported({"transmission": {"transmissionFactor": 1}, "ior": {"ior": ior}})
    assert any("index of refraction" in str(warning) for warning in scene.warnings)
    assert scene.materials[0].glass is not None
    assert scene.materials[0].glass.ior == 1.5


@pytest.mark.parametrize(
    ("ior", "color", "has_warning"), [(0.5, 1, True), (100, 1, True), (0, 1, True), (0, 0.2, False)]
)
def test_an_invalid_index_of_opaque_materials_gives_a_warning(ior: float, color: float, has_warning: bool) -> None:
    """Except 0, which files with colored highlights use."""
    scene = imported({"ior": {"ior": ior}, "specular": {"specularColorFactor": [color] * 3}})
    assert any("index of refraction" in str(warning) for warning in scene.warnings) == has_warning


def test_glass_is_as_rough_as_its_surface() -> None:
    scene = imported({"transmission": {"transmissionFactor": 1}})
    assert scene.materials[0].glass is not None
    assert scene.materials[0].glass.roughness == pytest.approx(0.5)


def test_transmission_textures_give_a_warning() -> None:
    glb = Glb()
    texture = {"index": glb.texture([[[255, 0, 0], [0, 0, 0]]])}
    passing = {"transmissionFactor": 1, "transmissionTexture": texture}
    scene = imported({"transmission": passing, "dispersion": {"dispersion": 1}}, glb)
    assert scene.materials[0].glass is not None
    np.testing.assert_allclose(scene.materials[0].glass.tint, [0.25, 0.125, 0.0625])
    for word in ("transmission texture", "Dispersion"):
        assert len([warning for warning in scene.warnings if word in str(warning)]) == 1
