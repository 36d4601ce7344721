"""Materials of USD: the same terms as glTF, textures with their color spaces, scales and transforms, MaterialX."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment_files import write_map
from glb_builder import DIELECTRIC_TRANSMISSION, QUAD_UVS, Glb
from texture_values import get_texture_values
from usd_text import BOUND, CHECKER, RGB, ST, WHITE, Files, imported, material, painted, png, quad, texture, usda

from relume.core.color import srgb_decode
from relume.scene.model import Material
from relume.scene_io.gltf import import_gltf
from relume.scene_io.materialx.import_document import import_materialx
from relume.scene_io.referenced_files import NoFiles

pytest.importorskip("pxr.Usd")

PIXELS = np.array([[[200, 30, 60], [20, 220, 120]], [[90, 10, 250], [130, 140, 150]]], np.uint8)
PACKED = np.array([[[0, 255, 0], [0, 51, 255]], [[0, 102, 0], [0, 204, 255]]], np.uint8)


def only(inputs: str, nodes: str = "", files: dict[str, Any] | None = None, properties: str = ST) -> Material:
    """The only material of a painted quad."""
    images = {name: png(pixels) for name, pixels in (files or {}).items()}
    scene = imported(usda(painted(inputs, nodes, properties)), Files(images))
    (scene_material,) = scene.materials
    return scene_material


def of_gltf(material: dict[str, Any], glb: Glb | None = None) -> Material:
    (scene_material,) = import_gltf((glb or Glb()).quad(material).bytes(), "test", WHITE).materials
    return scene_material


CASES = {
    "plain": (
        "",
        {"pbrMetallicRoughness": {"baseColorFactor": [0.18] * 3 + [1], "metallicFactor": 0, "roughnessFactor": 0.5}},
    ),
    "metal": (
        "color3f inputs:diffuseColor = (.9, .6, .2)\nfloat inputs:metallic = 1\nfloat inputs:roughness = .25",
        {"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.6, 0.2, 1], "metallicFactor": 1, "roughnessFactor": 0.25}},
    ),
    "between": (
        "color3f inputs:diffuseColor = (.9, .6, .2)\nfloat inputs:metallic = .5\nfloat inputs:ior = 1.8",
        {
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.9, 0.6, 0.2, 1], "metallicFactor": 0.5, "roughnessFactor": 0.5
            },
            "extensions": {"KHR_materials_ior": {"ior": 1.8}},
        },
    ),
    "coat": (
        "float inputs:clearcoat = .7\nfloat inputs:clearcoatRoughness = .1",
        {
            "pbrMetallicRoughness": {"baseColorFactor": [0.18] * 3 + [1], "metallicFactor": 0, "roughnessFactor": 0.5},
            "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.1}},
        },
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_preview_surface_has_the_terms_of_the_same_gltf_material(case: str) -> None:
    inputs, material = CASES[case]
    expected = of_gltf(material)
    ours = only(inputs)
    assert ours.terms == expected.terms
    assert (ours.name, ours.opacity, ours.glass) == ("Paint", None, None)


def test_textures_have_the_terms_and_bytes_of_the_same_gltf_material() -> None:
    glb = Glb()
    pbr = {
        "baseColorTexture": {"index": glb.texture(PIXELS)},
        "metallicRoughnessTexture": {"index": glb.texture(PACKED)},
    }
    expected = of_gltf({"pbrMetallicRoughness": pbr}, glb)
    inputs = f"""{RGB}
    float inputs:roughness.connect = </Paint/Packed.outputs:g>
    float inputs:metallic.connect = </Paint/Packed.outputs:b>"""
    nodes = texture("Image", "color.png") + texture("Packed", "packed.png", 'token inputs:sourceColorSpace = "raw"')
    ours = only(inputs, nodes, {"color.png": PIXELS, "packed.png": PACKED})
    assert ours.terms == expected.terms
    assert ours.textures.keys() == expected.textures.keys() == {"diffuse", "specular", "roughness"}
    for name, image in expected.textures.items():
        np.testing.assert_array_equal(ours.textures[name].pixels, image.pixels)
        assert ours.textures[name].encoding == image.encoding


def test_the_specular_workflow_has_its_color_at_normal_incidence() -> None:
    specular = (
        "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (.8, .4, .2)\nfloat inputs:metallic = 1"
    )
    diffuse, highlight = only(f"color3f inputs:diffuseColor = (.5, .5, .5)\n{specular}").terms
    np.testing.assert_allclose(highlight["params"]["f0"], [0.8, 0.4, 0.2])
    np.testing.assert_allclose(highlight["color"], [1, 1, 1])
    assert diffuse["color"][0] == pytest.approx(0.5 * (1 - 0.8), abs=2e-3)


@pytest.mark.parametrize(
    ("space", "expected"),
    [("sRGB", srgb_decode(PIXELS / 255)), ("auto", srgb_decode(PIXELS / 255)), ("raw", PIXELS / 255)],
)
def test_color_spaces_of_images(space: str, expected: np.ndarray) -> None:
    nodes = texture("Image", "color.png", f'token inputs:sourceColorSpace = "{space}"')
    values = get_texture_values(only(RGB, nodes, {"color.png": PIXELS}).textures["diffuse"])
    np.testing.assert_allclose(values, expected, atol=5e-3)


def test_scale_and_bias_of_colors_apply_to_linear_values() -> None:
    nodes = texture("Image", "color.png", "float4 inputs:scale = (.5, .5, 2, 1)\nfloat4 inputs:bias = (.25, 0, 0, 0)")
    values = get_texture_values(only(RGB, nodes, {"color.png": PIXELS}).textures["diffuse"])
    linear = srgb_decode(PIXELS / 255) * [0.5, 0.5, 2] + [0.25, 0, 0]
    np.testing.assert_allclose(values, np.clip(linear, 0, 1), atol=6e-3)


@pytest.mark.parametrize(
    ("scale", "bias", "expected"),
    [
        ("(2, 2, 2, 1)", "(-1, -1, -1, 0)", [0.6, -0.2, 0.77]),
        ("(2, -2, 2, 1)", "(-1, 1, -1, 0)", [0.6, 0.2, 0.77]),
        ("(1, 1, 2, 1)", "(0, 0, -1, 0)", [0.8, 0.4, 0.77]),
    ],
)
def test_normals_are_the_bytes_times_scale_plus_bias(scale: str, bias: str, expected: list[float]) -> None:
    nodes = texture("Image", "n.png", f"float4 inputs:scale = {scale}\nfloat4 inputs:bias = {bias}")
    normals = "normal3f inputs:normal.connect = </Paint/Image.outputs:rgb>"
    normal_map = only(normals, nodes, {"n.png": np.full((2, 2, 3), [204, 102, 225.7], np.uint8)}).normal_map
    assert normal_map is not None
    value = get_texture_values(normal_map)[0, 0]
    np.testing.assert_allclose(value / np.linalg.norm(value), np.array(expected) / np.linalg.norm(expected), atol=0.02)


def test_opacity_blends_cuts_or_lets_light_pass() -> None:
    image = np.zeros((1, 2, 4), np.uint8) + np.array([[[255, 0, 0, 128]], [[255, 0, 0, 255]]], np.uint8).reshape(
        1, 2, 4
    )
    alpha = f"{RGB}\nfloat inputs:opacity.connect = </Paint/Image.outputs:a>"
    nodes = texture("Image", "a.png")
    blended = only(alpha, nodes, {"a.png": image})
    assert blended.opacity is not None
    np.testing.assert_array_equal(blended.opacity.alpha, [[128, 255]])
    assert blended.opacity.cutoff is None
    cut = only(f"{alpha}\nfloat inputs:opacityThreshold = .6", nodes, {"a.png": image})
    assert cut.opacity is not None
    assert cut.opacity.cutoff == pytest.approx(0.6)
    presence = only('float inputs:opacity = .5\ntoken inputs:opacityMode = "presence"')
    assert presence.opacity is not None
    assert presence.opacity.alpha.item() == 128
    # the highlight of a transparent surface stays, and light passes with its color
    clear = only("color3f inputs:diffuseColor = (.8, 0, 0)\nfloat inputs:opacity = .25\nfloat inputs:ior = 1.4")
    assert clear.opacity is None
    assert clear.glass is not None
    assert (clear.glass.tint, clear.glass.ior, clear.glass.thickness) == ((0.75, 0.75, 0.75), 1.4, 0)
    assert clear.terms[0]["color"][0] == pytest.approx(0.2 * DIELECTRIC_TRANSMISSION, rel=0.03)
    assert clear.terms[1] == only("float inputs:ior = 1.4").terms[1]


def test_emission_is_a_light_with_the_mean_of_its_image() -> None:
    emissive = "color3f inputs:emissiveColor.connect = </Paint/Image.outputs:rgb>"
    nodes = texture("Image", "e.png", "float4 inputs:scale = (1, 1, 1, 1)")
    files = Files({"e.png": png([[[255, 255, 255], [0, 0, 0]]])})
    scene = imported(usda(painted(emissive, nodes)), files)
    (light,) = scene.lights
    assert (light.name, light.fields["kind"], light.fields["material"]) == ("Paint", "mesh", "Paint")
    np.testing.assert_allclose(light.fields["emission"], 0.5)
    constant = imported(usda(painted("color3f inputs:emissiveColor = (3, 2, 1)")))
    np.testing.assert_allclose(constant.lights[0].fields["emission"], [3, 2, 1])


def test_images_of_radiance_are_read_and_clamped_to_the_range_of_textures(tmp_path: Path) -> None:
    connected = "color3f inputs:diffuseColor.connect = </Paint/Image.outputs:rgb>"
    write_map(tmp_path / "c.exr", np.array([[[0.25, 0.5, 4.0]]], np.float32))
    files = Files({"c.exr": (tmp_path / "c.exr").read_bytes()})
    scene = imported(usda(painted(connected, texture("Image", "c.exr"))), files)
    texels = get_texture_values(scene.materials[0].textures["diffuse"])
    np.testing.assert_allclose(texels.reshape(-1, 3)[0], [0.25, 0.5, 1], atol=4e-3)
    assert "Values of “c.exr” above 1 are clamped in textures." in scene.warnings


TRANSFORMED = """
    def Shader "Image"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @color.png@
        token inputs:wrapS = "mirror"
        token inputs:wrapT = "clamp"
        float2 inputs:st.connect = </Paint/Transform.outputs:result>
        float3 outputs:rgb
    }
    def Shader "Transform"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </Paint/Reader.outputs:result>
        float inputs:rotation = %g
        float2 inputs:scale = (%g, %g)
        float2 inputs:translation = (%.9g, %.9g)
        float2 outputs:result
    }
    def Shader "Reader"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "map1"
        float2 outputs:result
    }
"""
MAP_1 = ST.replace("primvars:st", "primvars:map1")


def test_texture_transforms_scale_then_rotate_then_translate() -> None:
    nodes = TRANSFORMED % (30, 2, 3, 0.1, 0.2)
    scene = imported(usda(painted(RGB, nodes, f"{MAP_1}\n{ST}")), Files({"color.png": CHECKER}))
    mesh = scene.meshes[0]
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    top_right = np.array([[c, -s], [s, c]]) @ [2, 3] + [0.1, 0.2]
    corner = mesh.faces.reshape(-1)[2]  # (1, 1)
    np.testing.assert_allclose(mesh.uvs[corner], [top_right[0], 1 - top_right[1]], atol=1e-6)
    assert scene.materials[0].textures["diffuse"].wrap == ("mirror", "clamp")


def test_texture_transforms_are_those_that_exporters_write_for_gltf() -> None:
    # "All" of Khronos' TextureTransformTest: offset (−0.2, −0.1), rotation 0.3, scale 1.5
    glb = Glb()
    transform = {"KHR_texture_transform": {"offset": [-0.2, -0.1], "rotation": 0.3, "scale": [1.5, 1.5]}}
    info = {"index": glb.texture(PIXELS), "extensions": transform}
    glb.quad({"pbrMetallicRoughness": {"baseColorTexture": info}})
    expected = import_gltf(glb.bytes(), "test", WHITE).meshes[0]
    nodes = TRANSFORMED % (np.degrees(0.3), 1.5, 1.5, 0.24328034, -0.33300462)
    mesh = imported(usda(painted(RGB, nodes, MAP_1)), Files({"color.png": CHECKER})).meshes[0]
    corners = [int(mesh.faces.reshape(-1)[k]) for k in (0, 1, 2, 5)]
    np.testing.assert_allclose(mesh.uvs[corners], expected.uvs, atol=1e-5)
    np.testing.assert_array_equal(QUAD_UVS[0], [0, 1])


def test_other_texture_coordinates_are_used_if_there_is_one_set() -> None:
    scene = imported(usda(painted(RGB, texture("Image", "c.png"), MAP_1)), Files({"c.png": CHECKER}))
    assert np.ptp(scene.meshes[0].uvs) == 1
    assert "Texture coordinates “st” are missing in 1 mesh, for example “Quad”; “map1” are used." in scene.warnings


def test_missing_and_damaged_images_have_their_fallback() -> None:
    fallback = texture("Image", "none.png", "float4 inputs:fallback = (.1, .2, .3, 1)")
    scene = imported(usda(painted(RGB, fallback)))
    color = np.array(scene.materials[0].terms[0]["color"])
    np.testing.assert_allclose(color / DIELECTRIC_TRANSMISSION, [0.1, 0.2, 0.3], atol=1e-4)
    assert "Missing image “none.png” (a texture): import it together with the scene." in scene.warnings
    damaged = imported(usda(painted(RGB, texture("Image", "x.png"))), Files({"x.png": b"no image"}))
    assert damaged.materials[0].terms[0]["color"][0] == pytest.approx(0.18 * DIELECTRIC_TRANSMISSION, abs=1e-5)
    assert any("Skipped “x.png”" in warning for warning in damaged.warnings)


def test_display_colors_that_a_shader_reads() -> None:
    nodes = """
    def Shader "Image"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "displayColor"
        float3 outputs:result
    }"""
    color = 'color3f[] primvars:displayColor = [(0, .5, 1)] (\n interpolation = "constant"\n)'
    inputs = "color3f inputs:diffuseColor.connect = </Paint/Image.outputs:result>\nfloat inputs:roughness = .9"
    ours = only(inputs, nodes, properties=color)
    np.testing.assert_allclose(np.array(ours.terms[0]["color"]) / DIELECTRIC_TRANSMISSION, [0, 0.5, 1], atol=1e-4)
    assert ours.terms[1]["params"]["roughness"] == 0.9


def test_inputs_of_the_material_reach_its_shader() -> None:
    inputs = (
        "float inputs:roughness.connect = </Paint.inputs:gloss>\nfloat inputs:metallic.connect = </Paint.inputs:none>"
    )
    layer = usda(
        painted(inputs).replace('def Material "Paint"\n{', 'def Material "Paint"\n{\nfloat inputs:gloss = .75')
    )
    scene = imported(layer)
    assert scene.materials[0].terms[1]["params"]["roughness"] == 0.75
    assert not [warning for warning in scene.warnings if warning.severity == "unsupported"]


def test_what_a_shader_has_beyond_the_supported_is_one_warning_each() -> None:
    nodes = """
    def Shader "Image"
    {
        uniform token info:id = "Fancy"
        float3 outputs:rgb
    }"""
    scene = imported(usda(painted(f"{RGB}\nfloat inputs:displacement = .1", nodes)))
    assert [str(warning) for warning in scene.warnings] == [
        "diffuseColor of material “Paint” has its default: node “Image” (Fancy) isn't supported.",
        "Displacement of material “Paint” isn't supported; its surface is smooth.",
    ]
    unknown = imported(usda(painted("").replace("UsdPreviewSurface", "Fancy")))
    assert list(unknown.warnings) == ["Material “Paint” is shown gray: its shader “Fancy” isn't supported."]
    missing = imported(usda(quad(properties="rel material:binding = </Nowhere>", metadata=BOUND)))
    assert list(missing.warnings) == ["Material “Nowhere” of “Quad” is missing; it has its display color."]


MATERIALX = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709" fileprefix="maps/">
  <nodegraph name="NG">
    <image name="color" type="color3">
      <input name="file" type="filename" value="color.png" colorspace="srgb_texture"/>
    </image>
    <tiledimage name="rough" type="float">
      <input name="file" type="filename" value="rough.png"/>
      <input name="uvtiling" type="vector2" value="1, 1"/>
    </tiledimage>
    <output name="c" type="color3" nodename="color"/>
    <output name="r" type="float" nodename="rough"/>
  </nodegraph>
  <{shader} name="S" type="surfaceshader">
    {inputs}
  </{shader}>
  <surfacematerial name="Paint" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S"/>
  </surfacematerial>
</materialx>"""


def with_materialx(shader: str, inputs: str) -> Material:
    document = MATERIALX.format(shader=shader, inputs=inputs).encode()
    looks = 'def Scope "Looks" (\n references = @paint.mtlx@</MaterialX/Materials>\n) {\n}'
    body = quad(properties=f"{ST}\nrel material:binding = </Looks/Paint>", metadata=BOUND) + looks
    files = {"paint.mtlx": document, "maps/color.png": png(PIXELS), "maps/rough.png": png(PACKED[..., 1])}
    scene = imported(usda(body), Files(files))
    assert not [str(warning) for warning in scene.warnings if warning.severity == "unsupported"]
    (scene_material,) = scene.materials
    return scene_material


def number(name: str, value: str, kind: str = "float") -> str:
    return f'<input name="{name}" type="{kind}" value="{value}"/>'


def test_open_pbr_has_the_terms_of_the_same_gltf_material() -> None:
    inputs = (
        number("base_color", ".9, .6, .2", "color3")
        + number("base_metalness", "1")
        + number("specular_roughness", ".25")
    )
    assert with_materialx("open_pbr_surface", inputs).terms == only(CASES["metal"][0]).terms


def test_standard_surface_has_the_terms_of_the_same_gltf_material() -> None:
    inputs = number("base", ".5") + number("base_color", ".36, .36, .36", "color3") + number("specular_roughness", ".5")
    inputs += number("coat", ".7") + number("coat_roughness", ".1")
    ours = with_materialx("standard_surface", inputs)
    assert ours.terms == only(CASES["coat"][0]).terms


def test_images_of_materialx_have_their_color_space_and_prefix() -> None:
    inputs = '<input name="base_color" type="color3" nodegraph="NG" output="c"/>'
    inputs += '<input name="specular_roughness" type="float" nodegraph="NG" output="r"/>' + number("base", "1")
    ours = with_materialx("standard_surface", inputs)
    np.testing.assert_allclose(get_texture_values(ours.textures["diffuse"]), srgb_decode(PIXELS / 255), atol=5e-3)
    assert ours.terms[1]["params"]["roughness"] == pytest.approx(PACKED[..., 1].mean() / 255, abs=1e-4)


def test_glass_of_materialx_is_a_solid_with_its_tint() -> None:
    inputs = number("transmission", "1") + number("transmission_color", ".9, 1, .8", "color3") + number("base", "0")
    glass = with_materialx("standard_surface", inputs + number("specular_IOR", "1.4")).glass
    assert glass is not None
    np.testing.assert_allclose(glass.tint, [0.9, 1, 0.8], atol=0.05)
    assert glass.ior == 1.4
    deep = inputs + number("transmission_depth", "2")
    volume = with_materialx("standard_surface", deep).glass
    assert volume is not None
    assert volume.thickness == 0  # a quad has no depth


def network(shader: str, inputs: str, nodes: str = "") -> str:
    """A quad with a MaterialX network, and a gray placeholder for renderers that don't read it, as of Blender."""
    paint = "</Paint/Shader.outputs:out>"
    return (
        quad(properties=f"{ST}\nrel material:binding = </Paint>", metadata=BOUND)
        + f"""
def Material "Paint" {{
    token outputs:surface.connect = </Paint/Placeholder.outputs:out>
    token outputs:mtlx:surface.connect = {paint}
    def Shader "Placeholder" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (.8, .8, .8)
        token outputs:out
    }}
    def Shader "Shader" {{
        uniform token info:id = "{shader}"
        {inputs}
        token outputs:out
    }}
    {nodes}
}}"""
    )


def node(name: str, category: str, inputs: str, kind: str = "float3") -> str:
    return f"""def Shader "{name}" {{
        uniform token info:id = "ND_{category}"
        {inputs}
        {kind} outputs:out
    }}
    """


def test_a_materialx_network_precedes_the_surface_for_other_renderers() -> None:
    inputs = "color3f inputs:base_color = (.9, .6, .2)\nfloat inputs:base_metalness = 1"
    inputs += "\nfloat inputs:specular_roughness = .25\nfloat3 inputs:geometry_normal.connect = </Paint/N.outputs:out>"
    inputs += "\nfloat3 inputs:geometry_tangent.connect = </Paint/T.outputs:out>"
    nodes = node("N", "normal_vector3", 'string inputs:space = "world"') + node("T0", "tangent_vector3", "")
    nodes += node("T", "normalize_vector3", "float3 inputs:in.connect = </Paint/T0.outputs:out>")
    scene = imported(usda(network("ND_open_pbr_surface_surfaceshader", inputs, nodes)))
    assert scene.warnings == ()
    assert scene.materials[0].terms == only(CASES["metal"][0]).terms


def test_a_materialx_network_has_the_alpha_test_of_the_other_surface() -> None:
    inputs = "float inputs:geometry_opacity.connect = </Paint/Alpha.outputs:out>"
    alpha = node("Alpha", "image_float", "asset inputs:file = @a.png@", "float")
    body = network("ND_open_pbr_surface_surfaceshader", inputs, alpha)
    plain = "color3f inputs:diffuseColor = (.8, .8, .8)"
    for threshold, cutoff in ((0.0, None), (0.25, 0.25)):
        layer = usda(body.replace(plain, f"{plain}\nfloat inputs:opacityThreshold = {threshold}"))
        opacity = imported(layer, Files({"a.png": CHECKER})).materials[0].opacity
        assert opacity is not None
        assert opacity.cutoff == cutoff


def test_a_network_that_is_not_supported_shows_the_other_surface_with_a_warning() -> None:
    scene = imported(usda(network("ND_surface", "float inputs:opacity = 1")))
    assert scene.materials[0].terms == only("color3f inputs:diffuseColor = (.8, .8, .8)").terms
    (warning,) = scene.warnings
    assert warning.severity == "unsupported"
    assert "shown by its plain surface: its MaterialX shader “ND_surface” isn't supported" in warning


def test_surface_vectors_as_colors_are_a_warning() -> None:
    inputs = "color3f inputs:base_color.connect = </Paint/N.outputs:out>"
    scene = imported(usda(network("ND_open_pbr_surface_surfaceshader", inputs, node("N", "normal_vector3", ""))))
    assert any("base_color of material “Paint”" in warning for warning in scene.warnings)


def test_texture_coordinates_of_math_nodes() -> None:
    """u′ = R (S u) + t: S = (2, 3), R turns by 90° clockwise, as MaterialX has it, t = (¼, 0), v from the bottom."""
    inputs = "color3f inputs:base_color.connect = </Paint/Color.outputs:out>"
    steps = [
        node("A", "convert_vector2_vector3", "float2 inputs:in.connect = </Paint/Uv.outputs:out>"),
        node("B", "multiply_vector3", "float3 inputs:in1.connect = </Paint/A.outputs:out>"
             "\nfloat3 inputs:in2 = (2, 3, 1)"),
        node("C", "rotate3d_vector3", "float3 inputs:in.connect = </Paint/B.outputs:out>\nfloat inputs:amount = 0"
             "\nfloat3 inputs:axis = (1, 0, 0)"),
        node("D", "rotate3d_vector3", "float3 inputs:in.connect = </Paint/C.outputs:out>\nfloat inputs:amount = 90"
             "\nfloat3 inputs:axis = (0, 0, 1)"),
        node("E", "add_vector3", "float3 inputs:in1.connect = </Paint/D.outputs:out>\nfloat3 inputs:in2 = (.25, 0, 0)"),
        node("F", "convert_vector3_vector2", "float3 inputs:in.connect = </Paint/E.outputs:out>", "float2"),
        node("Uv", "texcoord_vector2", "", "float2"),
        node("Color", "image_color3", "asset inputs:file = @c.png@"
             "\nfloat2 inputs:texcoord.connect = </Paint/F.outputs:out>", "color3f"),
    ]  # fmt: skip
    scene = imported(
        usda(network("ND_open_pbr_surface_surfaceshader", inputs, "".join(steps))), Files({"c.png": CHECKER})
    )
    assert scene.warnings == ()
    upward = scene.meshes[0].uvs * (1, -1) + (0, 1)
    corners = scene.meshes[0].positions[:, :2] / 2 + 0.5
    expected = np.stack([0.25 + 3 * corners[:, 1], -2 * corners[:, 0]], axis=1)
    np.testing.assert_allclose(upward, expected, atol=1e-5)


def test_documents_with_entities_are_not_read() -> None:
    bomb = b'<!DOCTYPE x [<!ENTITY a "aaaa">]><materialx><surfacematerial name="&a;"/></materialx>'
    body = quad() + 'def Scope "Looks" (\n references = @paint.mtlx@</MaterialX/Materials>\n) {\n}'
    scene = imported(usda(body), Files({"paint.mtlx": bomb}))
    assert any("Skipped “paint.mtlx”: the .mtlx file defines entities" in warning for warning in scene.warnings)
    wide = imported(usda(body), Files({"paint.mtlx": bomb.decode().encode("utf-16")}))
    assert any("Skipped “paint.mtlx”: the .mtlx file defines entities" in warning for warning in wide.warnings)


def vector(name: str, value: str) -> str:
    return number(name, value, "color3")


SURFACES = {
    "open_pbr_surface": number("specular_roughness_anisotropy", ".5") + number("coat_weight", ".5")
    + vector("coat_color", "1, .5, .5") + number("coat_ior", "1.5") + number("base_metalness", ".5")
    + vector("specular_color", ".9, .8, .7") + number("fuzz_weight", ".5") + number("subsurface_weight", ".5"),
    "standard_surface": number("specular_anisotropy", ".5") + number("specular_rotation", ".25") + number("sheen", ".5")
    + number("transmission", ".5") + vector("transmission_color", ".5, 1, .25") + number("base", ".5")
    + vector("opacity", ".25, .5, .75") + number("emission", "2") + vector("emission_color", "1, .5, 0"),
    "gltf_pbr": vector("base_color", ".9, .6, .2") + number("metallic", ".5") + number("roughness", ".25")
    + number("alpha", ".5") + number("alpha_mode", "2", "integer") + number("clearcoat", ".7"),
    "UsdPreviewSurface": vector("diffuseColor", ".8, .4, .2") + number("opacity", ".25") + number("ior", "1.4")
    + number("useSpecularWorkflow", "1", "integer") + vector("specularColor", ".8, .4, .2"),
}  # fmt: skip


@pytest.mark.parametrize("shader", SURFACES)
def test_surfaces_of_usd_are_those_of_the_same_document(shader: str) -> None:
    pytest.importorskip("MaterialX", reason="pip install relume[materialx]")
    document = MATERIALX.format(shader=shader, inputs=SURFACES[shader]).encode()
    (expected,) = import_materialx(document, NoFiles()).materials
    looks = 'def Scope "Looks" (\n references = @paint.mtlx@</MaterialX/Materials>\n) {\n}'
    body = quad(properties=f"{ST}\nrel material:binding = </Looks/Paint>", metadata=BOUND) + looks
    (ours,) = imported(usda(body), Files({"paint.mtlx": document})).materials
    assert ours.terms == expected.material.terms
    if ours.glass is not None and expected.material.glass is not None:  # the quad of the stage has no depth
        assert replace(ours.glass, thickness=0) == replace(expected.material.glass, thickness=0)
    assert (ours.glass is None) == (expected.material.glass is None)
    assert (ours.opacity is None) == (expected.material.opacity is None)
    if ours.opacity is not None and expected.material.opacity is not None:
        np.testing.assert_array_equal(ours.opacity.alpha, expected.material.opacity.alpha)


def test_depths_of_transmission_are_in_the_unit_of_the_stage() -> None:
    inputs = (
        number("transmission", "1") + vector("transmission_color", ".5, 1, .25") + number("transmission_depth", "2")
    )
    document = MATERIALX.format(shader="standard_surface", inputs=inputs).encode()
    looks = 'def Scope "Looks" (\n references = @paint.mtlx@</MaterialX/Materials>\n) {\n}'
    binding = "rel material:binding = </Looks/Paint>"
    cube = f'def Cube "C" (\n{BOUND}\n) {{\n double size = 4\n {binding}\n}}\n'
    (ours,) = imported(usda(cube + looks, "metersPerUnit = 0.01\n"), Files({"paint.mtlx": document})).materials
    assert ours.glass is not None
    assert ours.glass.thickness == pytest.approx(0.04)
    np.testing.assert_allclose(ours.glass.absorbed, [np.log(2) / 0.02, 0, np.log(4) / 0.02], rtol=1e-5)


@pytest.mark.parametrize(
    ("wrap", "expected", "is_black"),
    [("", "repeat", True), ("useMetadata", "repeat", True), ("black", "clamp", True), ("clamp", "clamp", False),
     ("repeat", "repeat", False), ("mirror", "mirror", False)],
)  # fmt: skip
def test_wrap_modes(wrap: str, expected: str, *, is_black: bool) -> None:
    """Without metadata of the image, `useMetadata` is black outside, and so is the default; said where it is seen."""
    node = texture("Image", "c.png").replace(
        'token inputs:wrapS = "repeat"', f'token inputs:wrapS = "{wrap}"' * bool(wrap)
    )
    larger_st = ST.replace("(1, 0), (1, 1)", "(2, 0), (2, 1)")
    assert larger_st != ST
    for st, is_outside in ((ST, False), (larger_st, True)):
        scene = imported(usda(painted(RGB, node, st)), Files({"c.png": CHECKER}))
        assert scene.materials[0].textures["diffuse"].wrap == (expected, "repeat")
        sentence = "An image of material “Paint” is black outside its bounds in the file, which isn't supported."
        assert list(scene.warnings) == [sentence] * (is_black and is_outside)


def test_normals_without_their_scale_are_read_as_a_normal_map() -> None:
    """The values of texels are never vectors that all point to one side; exporters forget scale and bias."""
    connect = "normal3f inputs:normal.connect = </Paint/Image.outputs:rgb>"
    files = Files({"n.png": png([[[128, 128, 255], [160, 128, 250]]])})
    scaled = "float4 inputs:scale = (2, 2, 2, 1)\nfloat4 inputs:bias = (-1, -1, -1, 0)"
    exact, sloppy = (imported(usda(painted(connect, texture("Image", "n.png", more))), files) for more in (scaled, ""))
    assert exact.warnings == ()
    assert any("lacks the scale of normals" in warning for warning in sloppy.warnings)
    first, second = exact.materials[0].normal_map, sloppy.materials[0].normal_map
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.pixels, second.pixels)
    assert first.encoding == second.encoding


def test_the_specular_workflow_is_no_unusual_index_of_refraction() -> None:
    inputs = "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (.9, .7, .3)"
    scene = imported(usda(painted(f"{inputs}\ncolor3f inputs:diffuseColor = (0, 0, 0)")))
    assert scene.warnings == ()
    metal = only("color3f inputs:diffuseColor = (.9, .7, .3)\nfloat inputs:metallic = 1")
    assert scene.materials[0].terms == metal.terms


def test_emission_of_an_image_with_scale_and_bias() -> None:
    emissive = "color3f inputs:emissiveColor.connect = </Paint/Image.outputs:rgb>"
    nodes = texture("Image", "e.png", "float4 inputs:scale = (10, 10, 10, 1)\nfloat4 inputs:bias = (2, 0, 0, 0)")
    scene = imported(usda(painted(emissive, nodes)), Files({"e.png": png([[[255, 255, 255], [0, 0, 0]]])}))
    np.testing.assert_allclose(scene.lights[0].fields["emission"], [7, 5, 5], rtol=0.02)


def test_display_colors_are_scaled_by_the_weight_of_the_base() -> None:
    nodes = """
    def Shader "Color"
    {
        uniform token info:id = "ND_geompropvalue_color3"
        string inputs:geomprop = "displayColor"
        color3f outputs:out
    }"""
    surface = material("color3f inputs:base_color.connect = </Paint/Color.outputs:out>\nfloat inputs:base = .5", nodes)
    color = 'color3f[] primvars:displayColor = [(0, .5, 1)] (\n interpolation = "constant"\n)'
    body = quad(properties=f"{color}\nrel material:binding = </Paint>", metadata=BOUND)
    layer = body + surface.replace("UsdPreviewSurface", "ND_standard_surface_surfaceshader")
    scene = imported(usda(layer))
    colors = np.array(scene.materials[0].terms[0]["color"]) / DIELECTRIC_TRANSMISSION
    np.testing.assert_allclose(colors, [0, 0.25, 0.5], atol=1e-4)
    assert scene.warnings == ()


def test_values_above_1_of_scaled_colors_are_a_warning() -> None:
    node = texture("Image", "c.png", "float4 inputs:scale = (2, 2, 2, 1)")
    scene = imported(usda(painted(RGB, node)), Files({"c.png": CHECKER}))
    assert "Values above 1 of the base color texture of material “Paint” are clamped." in scene.warnings
