"""glTF as careless exporters write it: what can be repaired is, and one bad part does not cost the scene."""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_builder import QUAD, QUAD_NORMALS, QUAD_UVS, Glb
from PIL import Image

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.gltf import import_gltf
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.import_scene import import_scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
NBSP = "\u00a0"


def imported(glb: Glb) -> Scene:
    return import_gltf(glb.bytes(), "test", LIGHT)


def with_plain_quad(glb: Glb, **primitive: Any) -> Glb:
    """Add a primitive of the same quad, changed, before the plain one."""
    primitives = glb.document["meshes"][0]["primitives"]
    primitives.insert(0, {**primitives[0], **primitive})
    return glb


@pytest.mark.parametrize(
    ("pbr", "name", "value"),
    [
        ({"baseColorFactor": [1.0000001, 0.5, 0, 1], "metallicFactor": 0}, "color", [0.956463, 0.478231, 0]),
        ({"baseColorFactor": [-0.1, 0.5, 255, 1], "metallicFactor": 0}, "color", [0, 0.478231, 0.956463]),
        ({"roughnessFactor": 1.2, "metallicFactor": 1}, "roughness", 1),
    ],
)
def test_factors_out_of_range_are_clamped_with_a_warning(pbr: dict[str, Any], name: str, value: Any) -> None:
    scene = imported(Glb().quad({"pbrMetallicRoughness": pbr}))
    lambert, ggx = scene.materials[0].terms
    np.testing.assert_allclose(lambert["color"] if name == "color" else ggx["params"][name], value, atol=2e-6)
    assert all("clamped" in warning for warning in scene.warnings)
    assert {warning.severity for warning in scene.warnings} <= {"ignored", "approximated"}
    assert scene.warnings


@pytest.mark.parametrize(
    ("extension", "value", "expected"),
    [
        ("sheen", {"sheenColorFactor": [1.5, 0.5, 0], "sheenRoughnessFactor": 0.5}, [1, 0.5, 0]),
        ("clearcoat", {"clearcoatFactor": 7, "clearcoatRoughnessFactor": 0.5}, [1, 1, 1]),
    ],
)
def test_only_the_value_out_of_range_is_clamped(extension: str, value: Any, expected: list[float]) -> None:
    term = imported(Glb().quad({"extensions": {f"KHR_materials_{extension}": value}})).materials[0].terms[-1]
    assert term["color"] == expected
    assert term["params"]["roughness"] == 0.5


@pytest.mark.parametrize(
    ("volume", "absorbed"),
    [
        ({"attenuationDistance": 0, "attenuationColor": [0.5, 0.5, 0.5]}, [0, 0, 0]),
        ({"attenuationDistance": 2, "attenuationColor": [0.5, 1.1, 0.25]}, [np.log(2) / 2, 0, np.log(4) / 2]),
    ],
)
def test_volumes_out_of_range_absorb_as_clamped(volume: dict[str, Any], absorbed: list[float]) -> None:
    extensions = {"transmission": {"transmissionFactor": 1}, "volume": {"thicknessFactor": 1, **volume}}
    described = {"extensions": {f"KHR_materials_{name}": value for name, value in extensions.items()}}
    scene = imported(Glb().quad(described))
    glass = scene.materials[0].glass
    assert glass is not None
    assert glass.thickness == 1
    np.testing.assert_allclose(glass.absorbed, absorbed, atol=1e-6)
    assert scene.warnings


def test_empty_and_unused_parts_have_no_effect() -> None:
    glb = Glb().quad()
    document = glb.document
    document["meshes"].append({"primitives": []})
    document["accessors"] += [{"count": 0, "componentType": 5126, "type": "VEC3"}, {"componentType": 5130}, 7]
    document["bufferViews"] += [{"buffer": 0, "byteLength": 0}, {"buffer": 9}]
    document["bufferViews"][0]["byteStride"] = 0
    document["nodes"].append({"name": None, "children": None, "extensions": [], "mesh": 1})
    document["nodes"][0] |= {"name": None, "children": None, "extensions": []}
    document["cameras"] = document["skins"] = document["samplers"] = None
    document["materials"] = [{"pbrMetallicRoughness": 5}]
    document["scenes"][0]["nodes"].append(1)
    scene = imported(glb)
    np.testing.assert_array_equal(scene.meshes[0].positions, QUAD)
    assert scene.warnings == ()


@pytest.mark.parametrize(
    "primitive",
    [
        {"indices": 99},
        {"attributes": {"POSITION": 99}},
        {"attributes": {}},
        {"attributes": None},
        {"attributes": {"POSITION": "zero"}},
        {"mode": 1},
    ],
)
def test_a_primitive_that_cannot_be_read_does_not_cost_the_scene(primitive: dict[str, Any]) -> None:
    scene = imported(with_plain_quad(Glb().quad(), **primitive))
    assert len(scene.meshes) == 1
    np.testing.assert_array_equal(scene.meshes[0].positions, QUAD)
    assert [warning for warning in scene.warnings if warning.severity == "unsupported"]


def test_accessors_without_elements_are_left_out() -> None:
    glb = Glb().quad()
    glb.document["accessors"].append({"count": 0, "componentType": 5123, "type": "SCALAR", "bufferView": 3})
    assert len(imported(with_plain_quad(glb, indices=len(glb.document["accessors"]) - 1)).meshes) == 1


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_triangles_of_bad_positions_or_indices_are_left_out(value: float) -> None:
    positions = QUAD.copy()
    positions[3, 1] = value
    scene = imported(Glb().quad(POSITION=positions))
    np.testing.assert_array_equal(scene.meshes[0].positions, QUAD[:3])
    assert any("Removed 1 triangles" in warning for warning in scene.warnings)


def test_attributes_that_cannot_be_read_are_made_or_left_out() -> None:
    glb = Glb().quad(NORMAL=QUAD_NORMALS[:3])
    scene = imported(glb)
    np.testing.assert_allclose(scene.meshes[0].normals, np.tile([0, 0, 1], (6, 1)))
    assert any("3 NORMAL and 4 positions" in warning for warning in scene.warnings)


def test_all_faults_of_a_file_are_listed() -> None:
    glb = with_plain_quad(Glb().quad({"doubleSided": "maybe", "alphaMode": 5}), indices=98)
    glb.document["meshes"][0]["primitives"][1]["indices"] = 99
    with pytest.raises(SceneError, match="no triangles") as problem:
        imported(glb)
    assert "accessor 98" in str(problem.value)
    assert "accessor 99" in str(problem.value)
    glb.document["meshes"][0]["primitives"][1].pop("indices")
    warnings = " ".join(map(str, imported(glb).warnings))
    assert all(part in warnings for part in ("accessor 98", "“doubleSided” is “maybe”", "“alphaMode” is 5"))


def test_files_of_the_first_version_are_named() -> None:
    first = {"buffers": {"b": {"uri": "b.bin"}}, "meshes": {}, "nodes": {}, "scenes": {}}
    with pytest.raises(SceneError, match=r"the scene is glTF 1\.0.*export it as glTF 2\.0"):
        import_gltf(json.dumps(first).encode(), "test", LIGHT)


@pytest.mark.parametrize("padding", [b"\0", b"\0\0\0", b" \0"])
def test_json_padded_by_zeros_is_read(padding: bytes) -> None:
    glb = Glb().quad()
    data = glb.bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    text = json.dumps(json.loads(data[20 : 20 + length]), separators=(",", ":")).encode() + padding
    text += b"\0" * (-len(text) % 4)
    rest = data[20 + length :]
    packed = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON") + text + rest
    np.testing.assert_array_equal(import_gltf(packed, "test", LIGHT).meshes[0].positions, QUAD)


def _with_image(document: dict[str, Any], texture: dict[str, Any]) -> Glb:
    color = {"baseColorFactor": [0.5, 0.25, 1, 1], "metallicFactor": 0, "baseColorTexture": {"index": 0}}
    glb = Glb().quad({"pbrMetallicRoughness": color})
    glb.document |= {"textures": [texture], **document}
    return glb


@pytest.mark.parametrize(
    ("document", "texture", "reason"),
    [
        ({"images": [{"uri": "missing.png"}]}, {"source": 0}, "is missing"),
        ({}, {}, "has no image"),
        ({}, {"source": 3}, "image 3 of 0"),
        ({"images": [{}]}, {"source": 0}, "has no data"),
        ({}, {"extensions": {"EXT_texture_avif": {"source": 0}}}, "AVIF"),
        ({}, {"extensions": {"KHR_texture_basisu": {"source": 0}}}, "ktxdecompress"),
    ],
)
def test_images_that_cannot_be_read_are_left_out(document: Any, texture: Any, reason: str) -> None:
    scene = imported(_with_image(document, texture))
    np.testing.assert_allclose(scene.materials[0].terms[0]["color"], np.array([0.5, 0.25, 1]) * 0.956463, atol=1e-6)
    (warning,) = scene.warnings
    assert reason in warning
    assert warning.severity == "unsupported"


def test_a_texture_in_an_unreadable_format_has_its_fallback() -> None:
    """KHR_texture_basisu: the source outside the extension is for programs without it."""
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}})
    glb.texture(np.full((2, 2, 3), (255, 0, 0)))
    glb.document["images"].append({"bufferView": glb.view(b"\xabKTX 20\xbb\r\n\x1a\n"), "mimeType": "image/ktx2"})
    glb.document["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": 1}}
    glb.document["extensionsUsed"] = ["KHR_texture_basisu"]
    scene = imported(glb)
    np.testing.assert_array_equal(scene.materials[0].textures["diffuse"].pixels[0, 0], [255, 0, 0])
    assert scene.warnings == ()


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
def test_orientations_in_metadata_are_ignored(kind: str) -> None:
    """glTF defines no orientation: texture coordinates are of the pixels as they are stored."""
    stored = np.zeros((16, 8, 3), np.uint8)
    stored[:8, :, 0] = 255
    exif, encoded = Image.Exif(), io.BytesIO()
    exif[274] = 6
    Image.fromarray(stored).save(encoded, kind, exif=exif, quality=100)
    glb = Glb().quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}})
    glb.document["images"] = [{"bufferView": glb.view(encoded.getvalue())}]
    glb.document["textures"] = [{"source": 0}]
    pixels = imported(glb).materials[0].textures["diffuse"].pixels
    assert pixels.shape == (16, 8, 3)
    assert pixels[2, 4, 0] > 200 > 50 > pixels[13, 4, 0]


def test_an_image_that_is_too_large_is_left_out() -> None:
    encoded = io.BytesIO()
    Image.new("L", (8_200, 1)).save(encoded, "PNG")
    glb = _with_image({}, {"source": 0})
    glb.document["images"] = [{"bufferView": glb.view(encoded.getvalue())}]
    assert any("8200×1" in warning for warning in imported(glb).warnings)


def test_an_unreadable_normal_map_leaves_the_other_images() -> None:
    glb = Glb()
    base = glb.texture([[[255, 0, 0], [0, 255, 0]]])
    glb.document["textures"].append({})
    described = {"normalTexture": {"index": 1}, "pbrMetallicRoughness": {"baseColorTexture": {"index": base}}}
    material = imported(glb.quad(described)).materials[0]
    assert material.normal_map is None
    assert material.textures["specular"].pixels.shape == (1, 2, 3)


def test_deep_trees_are_shown() -> None:
    glb = Glb().quad()
    glb.document["nodes"] = [{"children": [k + 1], "translation": [0, 0, 1]} for k in range(500)] + [{"mesh": 0}]
    scene = imported(glb)
    np.testing.assert_allclose(scene.meshes[0].positions + scene.offset, QUAD + np.array([0, 0, 500]))


def test_nodes_that_cannot_be_placed_are_left_out() -> None:
    glb = Glb().quad()
    glb.document["nodes"] += [{"mesh": 0, "scale": [1e30, 1, 1], "children": [2]}, {"mesh": 0}]
    glb.document["scenes"] = [{"nodes": [1, 0, 77]}]
    scene = imported(glb)
    assert len(scene.meshes) == 1
    assert sorted(warning.split(" ")[0] for warning in scene.warnings) == ["Node", "The"]


@pytest.mark.parametrize("scenes", [{"scene": 5}, {"scenes": [{}]}, {"scenes": [{"nodes": []}], "scene": 0}])
def test_all_nodes_are_shown_if_the_scene_is_missing_or_empty(scenes: dict[str, Any]) -> None:
    glb = Glb().quad()
    glb.document |= scenes
    scene = imported(glb)
    np.testing.assert_array_equal(scene.meshes[0].positions, QUAD)
    assert any("All nodes are shown" in warning for warning in scene.warnings)


@pytest.mark.parametrize(
    ("name", "x", "severity"), [("", 1, "ignored"), ("Second", 2, None), ("2", 3, None), ("No", 1, "unsupported")]
)
def test_a_scene_of_several_is_read(name: str, x: float, severity: str | None) -> None:
    glb = Glb().quad()
    glb.document["nodes"] = [{"mesh": 0, "translation": [k, 0, 0]} for k in range(4)]
    glb.document |= {"scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [1]}, {"nodes": [3]}, {"nodes": [2]}]}
    glb.document["scenes"][3]["name"] = "Second"
    scene = import_gltf(glb.bytes(), "test", LIGHT, options=ImportOptions(scene_name=name))
    assert [mesh.positions[0, 0] for mesh in scene.meshes] == [x]
    assert [warning.severity for warning in scene.warnings] == ([severity] if severity else [])


def test_hidden_nodes_and_their_children_are_left_out() -> None:
    glb = Glb().quad()
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}, "children": [2, 3]}
    light = {"extensions": {"KHR_lights_punctual": {"light": 0}}}
    visible = {"extensions": {"KHR_node_visibility": {"visible": True}}, "mesh": 0, "translation": [2, 0, 0]}
    glb.document["nodes"] += [hidden, {"mesh": 0}, light, visible]
    glb.document["scenes"][0]["nodes"] += [1, 4]
    glb.document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    scene = imported(glb)
    assert [mesh.positions[0].tolist() for mesh in scene.meshes] == [[0, 0, 0], [2, 0, 0]]
    assert not scene.lights
    assert scene.warnings == ()


def test_unknown_extensions_are_named_wherever_they_are() -> None:
    glb = Glb()
    texture = {"index": glb.texture([[[1, 2, 3]]]), "extensions": {"EXT_info": {}}}
    glb.quad({"pbrMetallicRoughness": {"baseColorTexture": texture}, "extensions": {"EXT_material": {}}})
    document = glb.document
    document["extensions"] = {"EXT_file": {}}
    document["nodes"][0] |= {"extensions": {"EXT_node": {}, "KHR_xmp_json_ld": {}}, "name": "Chair"}
    document["meshes"][0]["primitives"][0]["extensions"] = {"EXT_primitive": {}}
    document["textures"][0]["extensions"] = {"EXT_texture": {}}
    document["cameras"] = [{"extensions": {"EXT_unused": {}}}]
    warnings = imported(glb).warnings
    kinds = {
        "EXT_file": "the file", "EXT_node": "node “Chair”", "EXT_primitive": "mesh “quad”", "EXT_texture": "texture 0",
        "EXT_info": "material 0", "EXT_material": "material “material”", "KHR_xmp_json_ld": "node “Chair”",
    }  # fmt: skip
    for name, label in kinds.items():
        (warning,) = (warning for warning in warnings if f"“{name}”" in warning)
        assert label in warning
        assert warning.severity == ("ignored" if "xmp" in name else "unsupported")
    assert len(warnings) == len(kinds)


@pytest.mark.parametrize("number", [2, 7])
def test_any_set_of_uvs_is_used(number: int) -> None:
    glb, other = Glb(), QUAD_UVS * np.float32(0.25)
    info = {"index": glb.texture([[[1, 2, 3], [4, 5, 6]]]), "texCoord": number}
    glb.quad({"pbrMetallicRoughness": {"baseColorTexture": info}}, **{f"TEXCOORD_{number}": other})
    scene = imported(glb)
    np.testing.assert_array_equal(scene.meshes[0].uvs, other)
    assert scene.warnings == ()


def test_textures_without_any_uvs_give_a_warning() -> None:
    glb = Glb()
    info = {"index": glb.texture([[[1, 2, 3], [4, 5, 6]]])}
    scene = imported(glb.quad({"pbrMetallicRoughness": {"baseColorTexture": info}}, TEXCOORD_0=None))
    np.testing.assert_array_equal(scene.meshes[0].uvs, 0)
    assert any("show one texel" in warning for warning in scene.warnings)


def test_missing_tangents_are_computed_one_by_one() -> None:
    tangents = np.array([[0, 1, 0, 1], [0, 0, 0, 0], [0, 0, 0, 1], [0, 1, 0, 1]], np.float32)
    glb = Glb()
    normal_map = {"index": glb.texture([[[128, 128, 255]]])}
    mesh = imported(glb.quad({"normalTexture": normal_map}, TANGENT=tangents)).meshes[0]
    np.testing.assert_allclose(mesh.tangents, [[0, 1, 0, 1], [1, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1]], atol=1e-6)


def _companions_of(buffer_name: str) -> tuple[bytes, bytes]:
    """A .gltf file that refers to a buffer by a name, and the buffer."""
    glb = Glb().quad()
    glb.document["buffers"] = [{"byteLength": len(glb.binary), "uri": buffer_name}]
    return json.dumps(glb.document).encode(), bytes(glb.binary)


@pytest.mark.parametrize(
    ("name", "stored"),
    [
        ("größe.bin", "gro\u0308ße.bin"),
        ("gro%CC%88%C3%9Fe.bin", "größe.bin"),
        ("Scene.BIN", "scene.bin"),
        ("wood: dark.bin", "wood: dark.bin"),
        (f"a{NBSP}b.bin", f"a{NBSP}b.bin"),
    ],
)
def test_names_of_files_differ_in_form_and_case(tmp_path: Path, name: str, stored: str) -> None:
    document, binary = _companions_of(name)
    (tmp_path / "a.gltf").write_bytes(document)
    (tmp_path / stored).write_bytes(binary)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("x/a.gltf", document)
        archive.writestr(f"x/{stored}", binary)
    for source in (tmp_path / "a.gltf", packed.getvalue()):
        np.testing.assert_array_equal(import_scene(source, "test", LIGHT).meshes[0].positions, QUAD)


@pytest.mark.parametrize("name", ["C:\\a.bin", "file:///a.bin", "https://a/b.bin", "../a.bin", "a\x1bb.bin"])
def test_names_outside_the_folder_are_not_opened(tmp_path: Path, name: str) -> None:
    document, _ = _companions_of(name)
    (tmp_path / "a.gltf").write_bytes(document)
    with pytest.raises(SceneError, match="outside the scene's folder"):
        import_scene(tmp_path / "a.gltf", "test", LIGHT)


def test_a_file_without_faults_says_why_nothing_is_shown() -> None:
    no_meshes, no_node, flat = Glb().quad(), Glb().quad(), Glb()
    del no_meshes.document["meshes"]
    no_meshes.document["nodes"] = [{}]
    no_node.document["nodes"] = [{}]
    flat.quad()
    flat.document["nodes"][0]["scale"] = [1, 0, 0]
    cases = {"the file has no meshes": no_meshes, "no node of the scene shows a mesh": no_node}
    flat_fault = "Skipped mesh “quad”: its scale is zero or it is too large"
    for contents, glb in (*cases.items(), (flat_fault, flat)):
        with pytest.raises(SceneError, match=re.escape(f"made of triangles ({contents})")):
            import_gltf(glb.bytes(), "test", LIGHT)


def test_far_nodes_keep_their_shape_with_cameras_and_lights() -> None:
    """Near 6,378 km single precision has steps of half a meter; the quads are 0.2 m wide and 1 m apart."""
    far = np.array([6_378_137.3, 0.25, -4_500_000.7])
    glb = Glb().quad()
    glb.document |= {
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 6830}]}},
        "nodes": [
            {"mesh": 0, "translation": far.tolist(), "scale": [0.2] * 3},
            {"mesh": 0, "translation": np.add(far, [1, 0, 0]).tolist(), "scale": [0.2] * 3},
            {"camera": 0, "translation": np.add(far, [0, 0, 3]).tolist()},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": np.add(far, [0, 2, 0]).tolist()},
        ],
        "scenes": [{"nodes": [0, 1, 2, 3]}],
    }
    scene = imported(glb)
    np.testing.assert_allclose(scene.offset, np.add(far, [0.6, 0.1, 0]), atol=1e-8)
    first, second = (mesh.positions for mesh in scene.meshes)
    np.testing.assert_allclose(first, 0.2 * QUAD - [0.6, 0.1, 0], atol=1e-6)
    np.testing.assert_allclose(second - first, [[1, 0, 0]] * 4, atol=1e-6)
    np.testing.assert_allclose(scene.cameras[0].to_world[:3, 3], [-0.6, -0.1, 3], atol=1e-6)
    np.testing.assert_allclose(scene.lights[0].fields["position"], [-0.6, 1.9, 0], atol=1e-6)
    assert sum("Positions are relative to" in warning for warning in scene.warnings) == 1
    fixed = import_gltf(glb.bytes(), "test", LIGHT, options=ImportOptions(recenter="never"))
    assert fixed.offset == (0, 0, 0)
