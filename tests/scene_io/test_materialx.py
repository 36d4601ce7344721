"""Materials of MaterialX documents: each model's values by hand, images by nodes, and hostile XML."""

from __future__ import annotations

import io
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest
from environment_files import write_map

from relume.brdf.evaluate import eval_brdf
from relume.core.color import srgb_decode
from relume.core.errors import MaterialError
from relume.scene.model import Texture
from relume.scene.texture_encoding import decode
from relume.scene_io.materialx.import_document import MaterialXDocument, import_materialx
from relume.scene_io.referenced_files import Folder, NamedFiles
from relume.scene_io.surfaces.make_material import ReadMaterial

pytest.importorskip("MaterialX", reason="pip install relume[materialx]")
DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "materialx"
F0 = 0.04
RISE = 0.0036845  # the mean of (1 - cos θd)^5


def png(pixels: Any) -> bytes:
    encoded = io.BytesIO()
    PIL.Image.fromarray(np.array(pixels, np.uint8)).save(encoded, "PNG")
    return encoded.getvalue()


def document(body: str, attributes: str = 'colorspace="lin_rec709"') -> bytes:
    return f'<?xml version="1.0"?><materialx version="1.39" {attributes}>{body}</materialx>'.encode()


def surface(model: str, inputs: str, nodes: str = "") -> bytes:
    material = '<surfacematerial name="M" type="material"><input name="surfaceshader" type="surfaceshader"'
    return document(
        f'{nodes}<{model} name="S" type="surfaceshader">{inputs}</{model}>{material} nodename="S"/></surfacematerial>'
    )


def number(name: str, value: float | str) -> str:
    return f'<input name="{name}" type="float" value="{value}"/>'


def color(name: str, *value: float, space: str = "") -> str:
    attribute = f' colorspace="{space}"' if space else ""
    return f'<input name="{name}" type="color3" value="{", ".join(map(str, value))}"{attribute}/>'


def connected(name: str, kind: str, node: str, output: str = "") -> str:
    return f'<input name="{name}" type="{kind}" nodename="{node}"' + (f' output="{output}"/>' if output else "/>")


def image(name: str, kind: str, file: str, extra: str = "", space: str = "", category: str = "image") -> str:
    attribute = f' colorspace="{space}"' if space else ""
    return (
        f'<{category} name="{name}" type="{kind}"><input name="file" type="filename" value="{file}"{attribute}/>'
        f"{extra}</{category}>"
    )


def read(data: bytes, files: Mapping[str, bytes] = {}) -> MaterialXDocument:
    return import_materialx(data, NamedFiles(dict(files), "", lambda content: content))


def only(data: bytes, files: Mapping[str, bytes] = {}) -> tuple[ReadMaterial, list[str]]:
    imported = read(data, files)
    (material,) = imported.materials
    return material, list(imported.warnings)


def texels(texture: Texture) -> Any:
    return decode(texture.pixels, texture.encoding)


def test_open_pbr_dielectric_with_a_tinted_coat() -> None:
    inputs = color("base_color", 0.1, 0.6, 0.9) + number("base_weight", 0.5) + number("specular_ior", 1.6)
    inputs += number("specular_roughness", 0.25) + number("coat_weight", 1) + color("coat_color", 1, 0.5, 0.5)
    read_material, warnings = only(surface("open_pbr_surface", inputs + number("coat_roughness", 0.02)))
    diffuse, highlight, coat = read_material.material.terms
    f0 = (0.6 / 2.6) ** 2
    mean = f0 + (1 - f0) * RISE
    assert diffuse["color"] == pytest.approx(np.array([0.05, 0.15, 0.225]) * (1 - mean), abs=1e-5)
    assert highlight["params"]["f0"] == pytest.approx([f0, f0 / 2, f0 / 2], abs=1e-5)
    assert highlight["params"]["roughness"] == 0.25
    assert coat["params"] == {"roughness": 0.02, "f0": pytest.approx(f0, abs=1e-6)}  # 1.6 is the coat's default, too
    assert warnings == [
        "The coat of material “M” is approximated: it doesn't darken the base, it is tinted the same from all sides."
    ]


@pytest.mark.parametrize(
    ("category", "weight", "ior"),
    [("open_pbr_surface", "coat_weight", "coat_ior"), ("standard_surface", "coat", "coat_IOR")],
)
def test_coats_have_their_index_of_refraction(category: str, weight: str, ior: str) -> None:
    """((n − 1) / (n + 1))² at normal incidence; no dielectric has 9, and the model's default is taken."""
    for value, n in ((2.0, 2.0), (9.0, {"coat_ior": 1.6, "coat_IOR": 1.5}[ior])):
        material, warnings = only(surface(category, number(weight, 1) + number(ior, value)))
        coat = material.material.terms[-1]
        assert coat["params"]["f0"] == pytest.approx(((n - 1) / (n + 1)) ** 2, abs=1e-6)
        assert any("index of refraction of the coat 9" in warning for warning in warnings) == (value == 9)


def test_open_pbr_metal_is_anisotropic_by_its_formula() -> None:
    inputs = color("base_color", 0.9, 0.8, 0.7) + number("base_metalness", 1) + number("specular_roughness", 0.4)
    material, _ = only(surface("open_pbr_surface", inputs + number("specular_roughness_anisotropy", 0.5)))
    highlight = material.material.terms[1]
    along = 0.16 * np.sqrt(2 / 1.25)
    assert highlight["params"]["nu"] == pytest.approx(2 / along**2 - 2, rel=1e-4)
    assert highlight["params"]["nv"] == pytest.approx(2 / (along / 2) ** 2 - 2, rel=1e-4)
    assert highlight["params"]["f0"] == [0.9, 0.8, 0.7]


def test_open_pbr_solid_absorbs_over_its_depth() -> None:
    inputs = number("transmission_weight", 1) + color("transmission_color", 0.5, 1, 0.25)
    material, warnings = only(
        surface("open_pbr_surface", inputs + number("transmission_depth", 2) + number("specular_ior", 1.33))
    )
    glass = material.material.glass
    assert glass is not None
    assert (glass.tint, glass.ior, glass.thickness) == ((1, 1, 1), 1.33, 2)
    assert glass.absorbed == pytest.approx([np.log(2) / 2, 0, np.log(4) / 2])
    assert warnings == []
    thin = inputs + '<input name="geometry_thin_walled" type="boolean" value="true"/>'
    glass = only(surface("open_pbr_surface", thin))[0].material.glass
    assert glass is not None
    assert (glass.tint, glass.thickness, glass.absorbed) == ((0.5, 1, 0.25), 0, (0, 0, 0))


def test_open_pbr_subsurface_fuzz_and_emission() -> None:
    inputs = color("base_color", 1, 0, 0) + number("subsurface_weight", 0.5) + color("subsurface_color", 0, 1, 0)
    inputs += number("specular_weight", 0) + number("emission_luminance", 20) + color("emission_color", 1, 0.5, 0)
    material, warnings = only(surface("open_pbr_surface", inputs))
    assert material.material.terms[0]["color"] == [0.5, 0.5, 0]
    assert material.material.terms[1]["color"] == [0, 0, 0]
    assert material.emission == (20, 10, 0)
    assert warnings == ["Subsurface scattering of material “M” is shown as diffuse reflection."]
    inputs = number("fuzz_weight", 0.5) + color("fuzz_color", 0.8, 0.4, 0.2) + number("fuzz_roughness", 0.6)
    sheen = only(surface("open_pbr_surface", inputs))[0].material.terms[2]
    assert (sheen["model"], sheen["color"], sheen["params"]) == ("sheen", [0.4, 0.2, 0.1], {"roughness": 0.6})


def test_standard_surface_values() -> None:
    inputs = number("base", 0.5) + color("base_color", 0.8, 0.4, 0.2) + number("specular_IOR", 1.5)
    inputs += number("specular_roughness", 0.3) + number("coat", 0.5) + number("coat_roughness", 0.2)
    material, warnings = only(surface("standard_surface", inputs))
    diffuse, highlight, coat = material.material.terms
    assert diffuse["color"] == pytest.approx(np.array([0.4, 0.2, 0.1]) * (1 - F0 - (1 - F0) * RISE), abs=1e-5)
    assert highlight["params"] == {"roughness": 0.3, "f0": [F0] * 3}
    assert (coat["color"], coat["params"]) == ([0.5] * 3, {"roughness": 0.2, "f0": F0})
    assert warnings == []


def test_standard_surface_anisotropy_and_rotation() -> None:
    inputs = number("metalness", 1) + number("specular_roughness", 0.4) + number("specular_anisotropy", 0.5)
    material, _ = only(surface("standard_surface", inputs + number("specular_rotation", 0.25)))
    params, aspect = material.material.terms[1]["params"], np.sqrt(0.55)
    assert params["nu"] == pytest.approx(2 / (0.16 / aspect) ** 2 - 2, rel=1e-4)
    assert params["nv"] == pytest.approx(2 / (0.16 * aspect) ** 2 - 2, rel=1e-4)
    assert material.tangent_rotation == pytest.approx(np.pi / 2)


def test_gltf_pbr_defaults_are_a_white_rough_metal() -> None:
    material, warnings = only(surface("gltf_pbr", ""))
    diffuse, highlight = material.material.terms
    assert diffuse["color"] == [0, 0, 0]
    assert highlight["params"] == {"roughness": 1, "f0": [1, 1, 1]}
    assert warnings == []


def test_preview_surface_workflows() -> None:
    metal, _ = only(surface("UsdPreviewSurface", color("diffuseColor", 0.9, 0.7, 0.3) + number("metallic", 1)))
    assert metal.material.terms[1]["params"] == {"roughness": 0.5, "f0": [0.9, 0.7, 0.3]}
    workflow = '<input name="useSpecularWorkflow" type="integer" value="1"/>'
    inputs = workflow + color("diffuseColor", 0.5, 0.5, 0.5) + color("specularColor", 0.08, 0.02, 0.01)
    plastic, _ = only(surface("UsdPreviewSurface", inputs))
    assert plastic.material.terms[1]["params"]["f0"] == pytest.approx([0.08, 0.02, 0.01])
    inputs = workflow + color("diffuseColor", 0, 0, 0) + color("specularColor", 0.9, 0.7, 0.3)
    same_metal, warnings = only(surface("UsdPreviewSurface", inputs))
    assert same_metal.material.terms == metal.material.terms
    assert warnings == []


def test_preview_surface_opacity_is_thin_glass_or_presence() -> None:
    inputs = color("diffuseColor", 0.5, 0.5, 0.5) + number("opacity", 0.25)
    glass = only(surface("UsdPreviewSurface", inputs))[0].material
    assert glass.glass is not None
    assert glass.glass.thickness == 0
    assert glass.opacity is None
    mode = '<input name="opacityMode" type="integer" value="1"/>'
    present = only(surface("UsdPreviewSurface", inputs + mode))[0].material
    assert present.glass is None
    assert present.opacity is not None
    np.testing.assert_array_equal(present.opacity.alpha, 64)


def test_images_have_the_color_space_of_their_file() -> None:
    """A color of the same bytes is sRGB or linear; roughness is linear."""
    files = {"maps/c.png": png([[[188, 0, 255]] * 2] * 2), "maps/r.png": png([[51, 204]] * 2)}
    for space, expected in (("srgb_texture", float(srgb_decode(np.array(188 / 255)))), ("lin_rec709", 188 / 255)):
        nodes = image("c", "color3", "maps/c.png", space=space) + image("r", "float", "maps\\R.PNG")
        inputs = connected("base_color", "color3", "c") + connected("specular_roughness", "float", "r")
        material, warnings = only(surface("open_pbr_surface", inputs, nodes), files)
        diffuse = texels(material.material.textures["diffuse"])
        assert diffuse[0, 0] == pytest.approx([expected, 0, 1], abs=4e-3)
        roughness = texels(material.material.textures["roughness"])
        assert material.material.terms[1]["params"]["roughness"] == pytest.approx(0.5)
        np.testing.assert_allclose(roughness[0, :, 0] * 0.5, [0.2, 0.8], atol=1e-3)
        assert warnings == []


def test_graph_outputs_channels_factors_and_interfaces() -> None:
    """The boombox's idiom within a graph: channels of one image, a factor by an interface, a scaled normal map."""
    graph = (
        '<nodegraph name="G"><input name="tint" type="color3" value="0.5, 1, 1"/>'
        + image("orm", "vector3", "orm.png")
        + '<separate3 name="s" type="multioutput"><input name="in" type="vector3" nodename="orm"/></separate3>'
        + image("c", "color3", "c.png", space="srgb_texture")
        + '<multiply name="m" type="color3"><input name="in1" type="color3" nodename="c"/>'
        '<input name="in2" type="color3" interfacename="tint"/></multiply>'
        + image("n", "vector3", "n.png")
        + '<normalmap name="nm" type="vector3"><input name="in" type="vector3" nodename="n"/>'
        '<input name="scale" type="float" value="0.5"/></normalmap>'
        '<output name="rough" type="float" nodename="s" output="outy"/>'
        '<output name="metal" type="float" nodename="s" output="outz"/>'
        '<output name="color" type="color3" nodename="m"/><output name="normal" type="vector3" nodename="nm"/>'
        "</nodegraph>"
    )
    inputs = "".join(
        f'<input name="{name}" type="{kind}" nodegraph="G" output="{output}"/>'
        for name, kind, output in (
            ("base_color", "color3", "color"),
            ("metallic", "float", "metal"),
            ("roughness", "float", "rough"),
            ("normal", "vector3", "normal"),
        )
    )
    files = {
        "orm.png": png([[[0, 51, 255]] * 2] * 2),
        "c.png": png([[[255, 255, 255], [0, 0, 0]]]),
        "n.png": png([[[255, 128, 255]]]),
    }
    material, warnings = only(surface("gltf_pbr", inputs, graph), files)
    highlight = material.material.terms[1]
    assert highlight["params"]["roughness"] == pytest.approx(0.2)
    f0 = texels(material.material.textures["specular"]) * np.array(highlight["params"]["f0"])
    np.testing.assert_allclose(f0[0], [[0.5, 1, 1], [0, 0, 0]], atol=5e-3)
    assert material.material.normal_map is not None
    np.testing.assert_allclose(texels(material.material.normal_map)[0, 0], np.array([1, 0, 2]) / np.sqrt(5), atol=5e-3)
    assert warnings == []


def test_old_documents_are_upgraded() -> None:
    """Version 1.38: `swizzle` and `channels`."""
    nodes = image("c", "color4", "c.png", space="srgb_texture")
    nodes += '<swizzle name="g" type="float"><input name="in" type="color4" nodename="c"/>'
    nodes += '<input name="channels" type="string" value="a"/></swizzle>'
    inputs = '<input name="base_color" type="color3" nodename="c" channels="rgb"/>'
    data = surface("standard_surface", inputs + connected("opacity", "float", "g"), nodes)
    files = {"c.png": png([[[255, 255, 255, 51]]])}
    material, warnings = only(data.replace(b"1.39", b"1.38"), files)
    assert material.material.opacity is not None
    assert material.material.opacity.alpha.tolist() == [[51]]
    assert warnings == []


@pytest.mark.parametrize(
    ("category", "extra", "scale", "offset"),
    [
        ("tiledimage", '<input name="uvtiling" type="vector2" value="2, 4"/>', (2, 4), (0, -3)),
        ("tiledimage", '<input name="uvoffset" type="vector2" value="0.25, 0.5"/>', (1, 1), (-0.25, 0.5)),
        ("image", connected("texcoord", "vector2", "p"), (2, 4), (0.25, -3.5)),
        ("image", connected("texcoord", "vector2", "x"), (3, 3), (0, -2)),
        ("gltf_image", '<input name="scale" type="vector2" value="2, 4"/>', (2, 4), (0, 0)),
        ("gltf_image", '<input name="offset" type="vector2" value="0.25, 0.5"/>', (1, 1), (0.25, 0.5)),
    ],
)
def test_texture_coordinates(
    category: str, extra: str, scale: tuple[float, float], offset: tuple[float, float]
) -> None:
    """With v from the top: place2d of scale 1/2, 1/4 and offset −1/4, 1/2; v′ = 1 − (4 (1 − v) − 1/2)."""
    nodes = (
        '<place2d name="p" type="vector2"><input name="scale" type="vector2" value="0.5, 0.25"/>'
        '<input name="offset" type="vector2" value="-0.25, -0.5"/></place2d>'
        '<texcoord name="t" type="vector2"/><multiply name="x" type="vector2">'
        '<input name="in1" type="vector2" nodename="t"/><input name="in2" type="float" value="3"/></multiply>'
    )
    nodes += image("c", "color3", "c.png", extra, "srgb_texture", category)
    material, warnings = only(
        surface("gltf_pbr", connected("base_color", "color3", "c"), nodes), {"c.png": png([[[9, 9, 9]]])}
    )
    transform = material.uv_slot.transform
    assert transform.scale == pytest.approx(scale)
    assert transform.offset == pytest.approx(offset)
    assert warnings == []


def test_unsupported_graphs_are_one_warning_each_and_have_the_default() -> None:
    nodes = '<noise2d name="noise" type="float"/>'
    inputs = connected("base_color", "color3", "noise") + connected("specular_roughness", "float", "noise")
    material, warnings = only(surface("open_pbr_surface", inputs + number("base_weight", "x"), nodes))
    assert material.material.terms[1]["params"]["roughness"] == 0.3
    assert material.material.terms[0]["color"] == pytest.approx([0.8 * (1 - F0 - (1 - F0) * RISE)] * 3, abs=1e-5)
    assert warnings == [
        "base_color of material “M” has its default: node “noise” (noise2d) isn't supported.",
        "specular_roughness of material “M” has its default: node “noise” (noise2d) isn't supported.",
        "base_weight of material “M” has its default: “x” is not a number.",
    ]


def test_missing_and_damaged_images_have_the_default_of_their_node() -> None:
    fallback = '<input name="default" type="color3" value="0.25, 0.5, 1"/>'
    nodes = image("c", "color3", "no.png", fallback) + image("r", "float", "bad.png")
    inputs = connected("base_color", "color3", "c") + connected("roughness", "float", "r") + number("metallic", 1)
    material, warnings = only(surface("gltf_pbr", inputs, nodes), {"bad.png": b"no image"})
    assert material.material.terms[1]["params"] == {"roughness": 1, "f0": [0.25, 0.5, 1]}
    assert len(warnings) == 2
    assert "no.png" in warnings[0]
    assert "image of roughness of material “M”" in warnings[1]


@pytest.mark.parametrize("value", ["nan", "inf", "-3", "1e300"])
def test_numbers_out_of_range_are_clamped_or_default(value: str) -> None:
    material, warnings = only(surface("open_pbr_surface", number("specular_roughness", value)))
    expected = {"nan": 0.3, "inf": 0.3, "-3": 0.01, "1e300": 1}[value]
    assert material.material.terms[1]["params"]["roughness"] == expected
    assert len(warnings) == 1


def test_colors_of_constants_are_decoded() -> None:
    inputs = color("base_color", 0.5, 0.5, 0.5, space="srgb_texture") + number("metallic", 1)
    material, warnings = only(surface("gltf_pbr", inputs))
    assert material.material.terms[1]["params"]["f0"] == pytest.approx([0.214041] * 3, abs=1e-5)
    assert warnings == []
    _, warnings = only(surface("gltf_pbr", color("base_color", 0.5, 0.5, 0.5, space="acescg")))
    assert warnings == ["The color space “acescg” isn't supported; it is read as linear Rec. 709."]


def test_shaders_without_a_material_and_unknown_shaders() -> None:
    body = '<gltf_pbr name="A" type="surfaceshader"/><gltf_pbr name="B" type="surfaceshader"/>'
    assert [each.material.name for each in read(document(body)).materials] == ["A", "B"]
    with pytest.raises(MaterialError, match="shader “disney_principled” isn't supported"):
        read(surface("disney_principled", ""))
    with pytest.raises(MaterialError, match="has no material that can be shown"):
        read(document(""))


# hostile XML


def test_includes_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "other.mtlx").write_bytes(document('<gltf_pbr name="Other" type="surfaceshader"/>'))
    for href in ("other.mtlx", str(tmp_path / "other.mtlx"), "/etc/passwd"):
        body = f'<xi:include href="{href}"/><gltf_pbr name="Own" type="surfaceshader"/>'
        data = document(body, 'xmlns:xi="http://www.w3.org/2001/XInclude"')
        imported = import_materialx(data, Folder(tmp_path))
        assert [each.material.name for each in imported.materials] == ["Own"]
        (warning,) = imported.warnings
        assert warning.severity == "ignored"
        assert href in warning


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not XML"),
        (b"\0\1\2", "not XML"),
        (b"<materialx", "not XML"),
        (b"<html/>", "not MaterialX"),
        (b'<!DOCTYPE m [<!ENTITY a "b">]><materialx>&a;</materialx>', "entities"),
        (b'<!DOCTYPE m [<!ENTITY a SYSTEM "file:///etc/passwd">]><materialx>&a;</materialx>', "entities"),
        (b"<materialx>" + b"<nodegraph>" * 100_000, "nested deeper"),
        (b"<materialx>" + b"<a/>" * 100_001 + b"</materialx>", "more than 100,000 elements"),
        (b"<materialx>" + b" " * (16 << 20) + b"</materialx>", "more than 16 MB"),
        (b'<?xml version="1.0" encoding="x-nothing"?><materialx/>', "encoding|not XML"),
        ('<?xml version="1.0" encoding="utf-16"?><materialx/>'.encode("utf-16"), "UTF-8"),
    ],
)
def test_hostile_xml_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(MaterialError, match=message):
        read(data)


@pytest.mark.parametrize("name", ["../secret.png", "/etc/passwd", "C:\\secret.png", "http://example.com/a.png"])
def test_images_outside_the_folder_are_not_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "secret.png").write_bytes(png([[[1, 2, 3]]]))
    (tmp_path / "scene").mkdir()
    nodes = image("c", "color3", name)
    imported = import_materialx(
        surface("gltf_pbr", connected("base_color", "color3", "c"), nodes), Folder(tmp_path / "scene")
    )
    assert imported.materials[0].material.textures == {}
    assert len(imported.warnings) == 1


def test_cyclic_and_exponential_graphs_end() -> None:
    loop = '<dot name="a" type="float"><input name="in" type="float" nodename="a"/></dot>'
    _, warnings = only(surface("gltf_pbr", connected("metallic", "float", "a"), loop))
    assert warnings == ["metallic of material “M” has its default: its node graph is too complex."]
    doubled = '<constant name="n0" type="float"><input name="value" type="float" value="1"/></constant>' + "".join(
        f'<multiply name="n{k + 1}" type="float"><input name="in1" type="float" nodename="n{k}"/>'
        f'<input name="in2" type="float" nodename="n{k}"/></multiply>'
        for k in range(60)
    )
    _, warnings = only(surface("gltf_pbr", connected("metallic", "float", "n60"), doubled))
    assert "too complex" in warnings[0]


def test_missing_library_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "MaterialX", None)
    with pytest.raises(MaterialError, match=r"pip install relume\[materialx\]"):
        read(surface("gltf_pbr", ""))


def test_files_of_materialx_itself() -> None:
    """Its own examples; three of their values by hand."""
    if not DATA.is_dir():
        pytest.skip("the folder of MaterialX's examples is missing")
    materials = {}
    for path in sorted(DATA.rglob("*.mtlx")):
        if path.name != "gltf_pbr_boombox.mtlx":  # large images
            (materials[path.stem],) = import_materialx(path.read_bytes(), Folder(path.parent)).materials
    assert len(materials) == 21
    terms = {name: each.material.terms for name, each in materials.items()}
    assert terms["gltf_pbr_gold"][1]["params"] == {"roughness": 0.02, "f0": [0.944, 0.776, 0.373]}
    assert terms["usd_preview_surface_gold"][1]["params"] == terms["gltf_pbr_gold"][1]["params"]
    assert terms["open_pbr_carpaint"][1]["params"]["f0"] == pytest.approx([0.053254] * 3, abs=1e-5)
    honey = materials["open_pbr_honey"].material.glass
    assert honey is not None
    assert honey.absorbed == pytest.approx(-np.log([0.83, 0.4, 0.04]) / 2)


# where the specifications decide


def reflectance_ratio(term: dict[str, Any], cosine: float) -> Any:
    """A highlight with its curves over the same without them, in the direction of the mirror."""
    wo = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    plain = {key: value for key, value in term.items() if key != "curves"}
    values = [eval_brdf(each | {"texture": None}, wo * [-1, 1, 1], wo) for each in (term, plain)]
    return values[0] / values[1]


def test_open_pbr_metals_have_the_edge_tint_of_their_specular_color() -> None:
    """F82-tint: tint · F at 82°, and F at normal incidence (section 3.6)."""
    inputs = color("base_color", 0.9, 0.8, 0.7) + number("base_metalness", 1)
    material, warnings = only(surface("open_pbr_surface", inputs + color("specular_color", 1, 0.6, 0.4)))
    highlight = material.material.terms[1]
    assert highlight["params"]["f0"] == [0.9, 0.8, 0.7]
    assert reflectance_ratio(highlight, 1 / 7) == pytest.approx([1, 0.6, 0.4], abs=0.02)
    assert reflectance_ratio(highlight, 0.999) == pytest.approx([1, 1, 1], abs=1e-3)
    assert warnings == []
    white = only(surface("open_pbr_surface", inputs))[0].material.terms[1]
    assert "curves" not in white
    _, warnings = only(surface("open_pbr_surface", inputs + number("specular_weight", 0.5)))
    assert warnings == ["specular_weight of material “M” doesn't scale the reflection of its metallic parts."]


def test_standard_surface_warns_of_the_edge_color_of_metals() -> None:
    inputs = number("metalness", 1) + color("specular_color", 1, 0.5, 0.5)
    _, warnings = only(surface("standard_surface", inputs))
    assert warnings == ["The edge color of the metallic parts of material “M” isn't supported; it is white."]


def test_transmitted_and_diffuse_light_have_their_own_colors() -> None:
    """mix(base, transmission_color, weight) of two layers, as in OpenPBR and Standard Surface."""
    inputs = color("base_color", 0.8, 0.4, 0.2) + color("transmission_color", 0.5, 1, 0.25)
    for model, weight in (("open_pbr_surface", "transmission_weight"), ("standard_surface", "transmission")):
        base = number("base", 1) if model == "standard_surface" else ""
        material, warnings = only(surface(model, inputs + base + number(weight, 0.5)))
        assert material.material.glass is not None
        assert material.material.glass.tint == pytest.approx((0.25, 0.5, 0.125))
        expected = np.array([0.4, 0.2, 0.1]) * (1 - F0 - (1 - F0) * RISE)
        assert material.material.terms[0]["color"] == pytest.approx(expected, abs=1e-5)
        assert warnings == []


def test_preview_surface_opacity_scales_its_diffuse_color_and_keeps_the_highlight() -> None:
    inputs = color("diffuseColor", 0.8, 0.4, 0.2) + number("ior", 1.4) + number("roughness", 0.6)
    glass = only(surface("UsdPreviewSurface", inputs + number("opacity", 0.25)))[0].material
    opaque = only(surface("UsdPreviewSurface", inputs))[0].material
    assert glass.glass is not None
    assert (glass.glass.tint, glass.glass.ior, glass.glass.roughness) == ((0.75, 0.75, 0.75), 1.4, 0)
    assert glass.terms[0]["color"] == pytest.approx(np.array(opaque.terms[0]["color"]) / 4, abs=1e-5)
    assert glass.terms[1] == opaque.terms[1]


@pytest.mark.parametrize(
    ("model", "name"),
    [("UsdPreviewSurface", "ior"), ("standard_surface", "specular_IOR"), ("open_pbr_surface", "specular_ior")],
)
def test_an_index_of_refraction_out_of_range_is_that_of_glass(model: str, name: str) -> None:
    material, warnings = only(surface(model, number(name, 0)))
    assert material.material.terms[1]["params"]["f0"] == pytest.approx([F0] * 3)
    assert warnings == ["The index of refraction 0 of material “M” is out of range; 1.5 is used."]


def test_differences_of_coats_and_tangents_are_warnings() -> None:
    inputs = number("coat", 1) + number("coat_anisotropy", 0.5) + number("coat_affect_roughness", 1)
    inputs += number("coat_affect_color", 1) + '<input name="tangent" type="vector3" value="0, 1, 0"/>'
    _, warnings = only(surface("standard_surface", inputs))
    assert warnings == [
        "tangent of material “M” isn't supported.",
        "The coat of material “M” is approximated: its highlight is round, it doesn't blur the base, it doesn't deepen "
        "the color of the base.",
    ]
    inputs = number("coat_weight", 1) + number("coat_roughness_anisotropy", 0.5) + number("coat_ior", 1.5)
    _, warnings = only(surface("open_pbr_surface", inputs + number("coat_darkening", 0)))
    assert warnings == ["The coat of material “M” is approximated: its highlight is round."]


def test_rotated_texture_coordinates() -> None:
    """place2d rotates clockwise, about the pivot: with v from the bottom u′ = v, v′ = 1 − u."""
    nodes = '<place2d name="p" type="vector2"><input name="pivot" type="vector2" value="0.5, 0.5"/>'
    nodes += '<input name="rotate" type="float" value="90"/></place2d>'
    nodes += image("c", "color3", "c.png", connected("texcoord", "vector2", "p"))
    material, warnings = only(
        surface("gltf_pbr", connected("base_color", "color3", "c"), nodes), {"c.png": png([[[9, 9, 9]]])}
    )
    corners = np.array([[0, 1], [1, 1], [0.25, 0]], np.float32)  # v from the top
    expected = np.array([[0, 0], [0, 1], [1, 0.25]])
    np.testing.assert_allclose(material.uv_slot.apply({"st": corners}, 3), expected, atol=1e-6)
    assert warnings == []


def test_textures_of_usd_with_scale_and_bias() -> None:
    nodes = (
        '<UsdUVTexture name="t" type="multioutput"><input name="file" type="filename" value="n.png"/>'
        '<input name="scale" type="color4" value="2, -2, 2, 1"/><input name="bias" type="color4" value="-1, 1, -1, 0"/>'
        "</UsdUVTexture>"
    )
    inputs = connected("normal", "vector3", "t", "rgb") + connected("metallic", "float", "t", "b")
    material, warnings = only(surface("UsdPreviewSurface", inputs, nodes), {"n.png": png([[[204, 102, 225]]])})
    assert material.material.normal_map is not None
    vector = np.array([0.6, 0.2, 225 / 127.5 - 1])
    expected = vector / np.linalg.norm(vector)
    np.testing.assert_allclose(texels(material.material.normal_map)[0, 0], expected, atol=0.01)
    diffuse = texels(material.material.textures["diffuse"])[0, 0] * material.material.terms[0]["color"]
    np.testing.assert_allclose(diffuse, [0.18 * (1 - vector[2]) * (1 - F0 - (1 - F0) * RISE)] * 3, rtol=0.02)
    assert warnings == []


def test_images_of_radiance_and_edges_that_are_extended(tmp_path: Path) -> None:
    write_map(tmp_path / "c.exr", np.array([[[0.25, 0.5, 4.0]]], np.float32))
    clamped = '<input name="uaddressmode" type="string" value="constant"/>'
    nodes = image("c", "color3", "c.exr", clamped)
    material, warnings = only(
        surface("standard_surface", connected("base_color", "color3", "c") + number("base", 1), nodes),
        {"c.exr": (tmp_path / "c.exr").read_bytes()},
    )
    texture = material.material.textures["diffuse"]
    np.testing.assert_allclose(texels(texture)[0, 0], [0.25, 0.5, 1], atol=4e-3)
    assert texture.wrap == ("clamp", "repeat")
    assert warnings == [
        "Values of “c.exr” above 1 are clamped in textures.",
        "An image of material “M” is black outside its bounds in the file, which isn't supported.",
    ]


def test_an_image_of_a_full_coats_color_tints_the_base() -> None:
    """The idiom of MaterialX's tiled brass: a white metal below a coat with the color of an image."""
    nodes = image("c", "color3", "c.png", space="srgb_texture")
    inputs = color("base_color", 0.5, 1, 1) + number("base", 1) + number("metalness", 1) + number("coat", 1)
    inputs += connected("coat_color", "color3", "c")
    material, _ = only(surface("standard_surface", inputs, nodes), {"c.png": png([[[255, 255, 0], [0, 255, 255]]])})
    f0 = texels(material.material.textures["specular"]) * np.array(material.material.terms[1]["params"]["f0"])
    np.testing.assert_allclose(f0[0], [[0.5, 1, 0], [0, 1, 1]], atol=5e-3)
