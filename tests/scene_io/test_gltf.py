"""glTF import of small files built by code and of real ones."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_builder import DIELECTRIC_TRANSMISSION, QUAD, QUAD_NORMALS, QUAD_UVS, Glb, self_contained
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.brdf.registry import TERMS
from relume.scene.model import Material, Mesh, Scene
from relume.scene.texture_encoding import mean_value
from relume.scene_io.gltf import import_gltf

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))


def imported(glb: Glb) -> Scene:
    return import_gltf(glb.bytes(), "test", LIGHT)


def face_normals(mesh: Mesh) -> np.ndarray:
    corners = mesh.positions[mesh.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def material_of(description: dict[str, Any], glb: Glb | None = None) -> Material:
    return imported((glb or Glb()).quad(description)).materials[0]


def test_a_plain_quad_is_imported_unchanged() -> None:
    scene = imported(Glb().quad())
    mesh = scene.meshes[0]
    np.testing.assert_array_equal(mesh.positions, QUAD)
    np.testing.assert_array_equal(mesh.normals, QUAD_NORMALS)
    np.testing.assert_array_equal(mesh.uvs, QUAD_UVS)
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3]])
    assert scene.warnings == ()
    assert scene.environment is LIGHT


def test_the_studio_lights_a_file_without_environment() -> None:
    assert import_gltf(Glb().quad().bytes(), "test").environment.name == "studio"


def test_translation_rotation_and_scale_act_in_this_order() -> None:
    glb = Glb().quad()
    half = np.sqrt(0.5)
    glb.document["nodes"] = [
        {"children": [1], "translation": [10, 0, 0]},
        {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 1, 1], "translation": [0, 1, 0]},
    ]
    mesh = imported(glb).meshes[0]
    # (1, 0, 0) → scaled (2, 0, 0) → rotated by 90° about z (0, 2, 0) → moved (0, 3, 0) → parent (10, 3, 0)
    np.testing.assert_allclose(mesh.positions[1], [10, 3, 0], atol=1e-6)
    np.testing.assert_allclose(mesh.normals[0], [0, 0, 1], atol=1e-6)


def test_matrices_are_column_major() -> None:
    glb = Glb().quad()
    glb.document["nodes"][0]["matrix"] = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]
    np.testing.assert_allclose(imported(glb).meshes[0].positions[0], [5, 6, 7])


def test_normals_take_the_inverse_transpose() -> None:
    slanted = np.repeat(np.array([[0.6, 0, 0.8]], np.float32), 4, axis=0)
    glb = Glb().quad(NORMAL=slanted)
    glb.document["nodes"][0]["scale"] = [2, 1, 1]
    expected = np.array([0.3, 0, 0.8]) / np.hypot(0.3, 0.8)
    np.testing.assert_allclose(imported(glb).meshes[0].normals[0], expected, atol=1e-6)


@pytest.mark.parametrize("scale", [[-1, 1, 1], [-1, -1, -1], [1, 2, -3]])
def test_reflections_flip_faces_and_normals(scale: list[float]) -> None:
    glb = Glb().quad()
    glb.document["nodes"][0]["scale"] = scale
    mesh = imported(glb).meshes[0]
    np.testing.assert_allclose(face_normals(mesh), mesh.normals[:2], atol=1e-6)


def test_instances_are_separate_meshes_with_separate_names() -> None:
    glb = Glb().quad()
    glb.document["nodes"] = [{"mesh": 0, "name": "chair", "translation": [i, 0, 0]} for i in range(3)]
    glb.document["scenes"] = [{"nodes": [0, 1, 2]}]
    scene = imported(glb)
    assert [mesh.name for mesh in scene.meshes] == ["chair", "chair 2", "chair 3"]
    assert [float(mesh.positions[0, 0]) for mesh in scene.meshes] == [0, 1, 2]


def test_missing_normals_are_flat() -> None:
    bent = QUAD.copy()
    bent[3, 2] = 1
    mesh = imported(Glb().quad(POSITION=bent, NORMAL=None)).meshes[0]
    assert len(mesh.positions) == 6
    np.testing.assert_allclose(mesh.normals, np.repeat(face_normals(mesh), 3, axis=0), atol=1e-6)


def test_a_zero_normal_is_replaced_by_the_face_normals() -> None:
    normals = QUAD_NORMALS.copy()
    normals[2] = 0
    scene = imported(Glb().quad(NORMAL=normals))
    np.testing.assert_allclose(scene.meshes[0].normals[2], [0, 0, 1], atol=1e-6)
    assert "1 zero-length normals" in scene.warnings[0]


@pytest.mark.parametrize(("mode", "corners"), [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
def test_strips_and_fans_face_the_same_way(mode: int, corners: list[int]) -> None:
    glb = Glb().quad()
    primitive = glb.document["meshes"][0]["primitives"][0]
    primitive |= {"mode": mode, "indices": glb.accessor(np.array(corners, np.uint16))}
    mesh = imported(glb).meshes[0]
    assert len(mesh.faces) == 2
    np.testing.assert_allclose(face_normals(mesh), [[0, 0, 1]] * 2, atol=1e-6)


def test_sparse_accessors_replace_their_elements() -> None:
    glb = Glb().quad()
    indices, values = glb.view(np.array([2], np.uint16).tobytes()), glb.view(np.array([2, 2, 0], "<f4").tobytes())
    glb.document["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5123},
        "values": {"bufferView": values},
    }
    np.testing.assert_array_equal(imported(glb).meshes[0].positions[2], [2, 2, 0])


def test_normalized_and_strided_attributes_are_scaled() -> None:
    uvs = np.zeros((4, 4), np.uint8)  # two of four bytes used: a stride of 4
    uvs[:, :2] = [[0, 255], [255, 255], [255, 0], [0, 51]]
    glb = Glb().quad()
    view = glb.view(uvs.tobytes())
    glb.document["bufferViews"][view]["byteStride"] = 4
    accessor = {"bufferView": view, "componentType": 5121, "normalized": True, "count": 4, "type": "VEC2"}
    glb.document["accessors"].append(accessor)
    attributes = glb.document["meshes"][0]["primitives"][0]["attributes"]
    attributes["TEXCOORD_0"] = len(glb.document["accessors"]) - 1
    np.testing.assert_allclose(imported(glb).meshes[0].uvs, [[0, 1], [1, 1], [1, 0], [0, 0.2]], atol=1e-6)


def test_a_dielectric_becomes_lambert_and_ggx() -> None:
    pbr = {"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0, "roughnessFactor": 0.3}
    lambert, ggx = material_of({"name": "Clay", "pbrMetallicRoughness": pbr}).terms
    assert (lambert["model"], lambert["texture"]) == ("lambert", None)
    np.testing.assert_allclose(lambert["color"], np.array([0.5, 0.25, 0.125]) * DIELECTRIC_TRANSMISSION, atol=1e-6)
    assert ggx["params"] == {"roughness": 0.3, "f0": [0.04, 0.04, 0.04]}


def test_a_metal_has_no_diffuse_part() -> None:
    pbr = {"baseColorFactor": [1, 0.5, 0.25, 1], "metallicFactor": 1, "roughnessFactor": 0}
    lambert, ggx = material_of({"pbrMetallicRoughness": pbr}).terms
    assert lambert["color"] == [0, 0, 0]
    assert ggx["params"] == {"roughness": 0.01, "f0": [1, 0.5, 0.25]}


def test_parameters_stay_in_the_ranges_of_the_terms() -> None:
    for metallic, roughness in ((0, 0), (1, 1), (0.5, 0.01)):
        pbr = {"metallicFactor": metallic, "roughnessFactor": roughness}
        for term in material_of({"pbrMetallicRoughness": pbr}).terms:
            for name, value in term.get("params", {}).items():
                parameter = TERMS[term["model"]].parameter(name)
                values = np.atleast_1d(value)
                assert parameter.minimum <= values.min() <= values.max() <= parameter.maximum


def test_base_color_textures_are_linearized_into_the_diffuse_channel() -> None:
    glb = Glb()
    index = glb.texture([[[0, 128, 255], [255, 0, 10]]], {"wrapS": 33_071, "wrapT": 33_648})
    pbr = {"baseColorTexture": {"index": index}, "baseColorFactor": [0.5, 1, 1, 1], "metallicFactor": 0}
    material = material_of({"pbrMetallicRoughness": pbr}, glb)
    expected = [[[0, 0.2158605, 1], [1, 0, 10 / 255 / 12.92]]]
    np.testing.assert_allclose(get_texture_values(material.textures["diffuse"]), expected, atol=1e-6)
    assert material.textures["diffuse"].wrap == ("clamp", "mirror")
    assert [term["texture"] for term in material.terms] == ["diffuse", None]
    np.testing.assert_allclose(material.terms[0]["color"], np.array([0.5, 1, 1]) * DIELECTRIC_TRANSMISSION, atol=1e-6)


def test_metallic_textures_divide_the_base_color() -> None:
    glb = Glb()
    base = glb.texture([[[255, 255, 255], [255, 255, 255]]])
    packed = glb.texture([[[0, 51, 0], [0, 51, 255]]])
    pbr = {"baseColorTexture": {"index": base}, "metallicRoughnessTexture": {"index": packed}}
    material = material_of({"pbrMetallicRoughness": pbr}, glb)
    np.testing.assert_allclose(get_texture_values(material.textures["diffuse"])[0, :, 0], [1, 0])
    ggx = material.terms[1]
    f0 = np.array(ggx["params"]["f0"]) * get_texture_values(material.textures["specular"])[0]
    np.testing.assert_allclose(f0, [[0.04] * 3, [1.0] * 3], rtol=0.02)  # 8-bit display values
    assert ggx["params"]["roughness"] == pytest.approx(0.2)
    assert ggx["texture"] == "specular"


def test_roughness_textures_scale_the_width_or_give_their_mean() -> None:
    glb = Glb()
    packed = glb.texture([[[0, 0, 0], [0, 255, 0]]])
    pbr = {"metallicRoughnessTexture": {"index": packed}, "roughnessFactor": 0.8}
    scene = imported(glb.quad({"name": "Clay", "pbrMetallicRoughness": pbr}))
    assert scene.materials[0].terms[1]["params"]["roughness"] == pytest.approx(0.4)
    assert scene.materials[0].terms[1]["roughness_map"] == "roughness"
    assert scene.materials[0].textures["roughness"].pixels.tolist() == [[[0], [255]]]
    assert mean_value(scene.materials[0].textures["roughness"]).tolist() == pytest.approx([1.0])
    assert not scene.warnings

    glb = Glb()
    plain = glb.texture([[[0, 200, 0], [0, 201, 0]]])
    pbr = {"metallicRoughnessTexture": {"index": plain}}
    material = material_of({"pbrMetallicRoughness": pbr}, glb)
    assert "roughness" not in material.textures
    assert "roughness_map" not in material.terms[1]


def test_webp_textures_are_read() -> None:
    glb = Glb()
    index = glb.texture(np.full((4, 4, 3), 255), kind="WEBP")
    glb.document["textures"][index] = {"extensions": {"EXT_texture_webp": {"source": 0}}}
    material = material_of({"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}}, glb)
    assert material.textures["diffuse"].pixels.shape == (4, 4, 3)


def test_normal_maps_are_scaled_and_get_tangents() -> None:
    glb = Glb()
    index = glb.texture([[[255, 128, 255]]])
    scene = imported(glb.quad({"normalTexture": {"index": index, "scale": 0.5}}))
    normal_map = scene.materials[0].normal_map
    assert normal_map is not None
    np.testing.assert_allclose(
        get_texture_values(normal_map)[0, 0], np.array([0.5, 0, 1]) / np.hypot(0.5, 1), atol=5e-3
    )
    # u runs along +X and v down: the tangent is +X, and cross(n, t)·w points up, against v.
    np.testing.assert_allclose(scene.meshes[0].tangents, [[1, 0, 0, 1]] * 4, atol=1e-6)


def test_tangents_of_mirrored_uvs_change_handedness() -> None:
    glb = Glb()
    index = glb.texture([[[128, 128, 255]]])
    mirrored = QUAD_UVS * np.array([-1, 1], np.float32)
    scene = imported(glb.quad({"normalTexture": {"index": index}}, TEXCOORD_0=mirrored))
    np.testing.assert_allclose(scene.meshes[0].tangents, [[-1, 0, 0, -1]] * 4, atol=1e-6)


def test_texture_transforms_move_coordinates() -> None:
    glb = Glb()
    moved = {"offset": [0.5, 0.25], "rotation": np.pi / 2, "scale": [2, 3]}
    info = {"index": glb.texture([[[1, 2, 3]]]), "extensions": {"KHR_texture_transform": moved}}
    mesh = imported(glb.quad({"pbrMetallicRoughness": {"baseColorTexture": info}})).meshes[0]
    # (u, v) = (1, 0) → (2, 0) → 90° counter-clockwise with v down: (0, -2) → (0.5, -1.75)
    np.testing.assert_allclose(mesh.uvs[2], [0.5, -1.75], atol=1e-6)


def at(scale, offset=(0, 0), **more):
    return {"extensions": {"KHR_texture_transform": {"scale": scale, "offset": list(offset)}}} | more


def test_images_with_different_repeats_are_tiled() -> None:
    """The normal map repeats four times along u and twice along v relative to the base color."""
    rng, glb = np.random.default_rng(3), Glb()
    bumps, base = rng.integers(0, 255, (6, 4, 3)), rng.integers(0, 255, (2, 2, 3))
    of_base = {"index": glb.texture(base)} | at([0.5, 2], (0.25, 0.5))
    of_bumps = {"index": glb.texture(bumps)} | at([2, 4], (0.5, 1.5))
    material = {"normalTexture": of_bumps, "pbrMetallicRoughness": {"baseColorTexture": of_base, "metallicFactor": 0}}
    scene = imported(glb.quad(material))
    assert not scene.warnings
    normal_map = scene.materials[0].normal_map
    assert normal_map is not None
    # u of the normal map is 4 u of the base color − 0.5, two texels of four; v is 2 v + 0.5, three of six
    np.testing.assert_array_equal(normal_map.pixels, np.tile(np.roll(bumps, (-3, 2), axis=(0, 1)), (2, 4, 1)))
    np.testing.assert_allclose(scene.meshes[0].uvs, QUAD_UVS * [0.5, 2] + [0.25, 0.5])


@pytest.mark.parametrize("other", [at([1.5, 1]), {"texCoord": 1}, at([9000, 1])])
def test_incompatible_texture_transforms_give_a_warning(other) -> None:
    glb = Glb()
    base, bumps = ({"index": glb.texture([[[1, 2, 3], [3, 4, 5]]])} for _ in range(2))
    scene = imported(glb.quad({"normalTexture": bumps | other, "pbrMetallicRoughness": {"baseColorTexture": base}}))
    assert any("different UV transforms" in warning for warning in scene.warnings)


@pytest.mark.parametrize("number", [0, 1])
def test_the_first_set_of_uvs_replaces_a_missing_one_with_a_warning(number: int) -> None:
    glb, other = Glb(), np.full((4, 2), 0.25, np.float32)
    info = {"index": glb.texture(np.zeros((1, 2, 3))), "texCoord": number}
    glb.quad({"pbrMetallicRoughness": {"baseColorTexture": info}}, TEXCOORD_0=None, TEXCOORD_1=other)
    scene = imported(glb)
    np.testing.assert_array_equal(scene.meshes[0].uvs, other)
    assert len([warning for warning in scene.warnings if "TEXCOORD_1 is used" in warning]) == (number == 0)


def test_the_second_uv_set_is_used_if_referenced() -> None:
    glb = Glb()
    info = {"index": glb.texture([[[1, 2, 3]]]), "texCoord": 1}
    other = QUAD_UVS * np.float32(0.5)
    mesh = imported(glb.quad({"pbrMetallicRoughness": {"baseColorTexture": info}}, TEXCOORD_1=other)).meshes[0]
    np.testing.assert_array_equal(mesh.uvs, other)


def test_cameras_are_rigid_with_names_valid_in_urls() -> None:
    glb = Glb().quad()
    glb.document["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": 0.6, "aspectRatio": 1.5}, "name": "Über Küche / 1"},
        {"type": "orthographic"},
    ]
    glb.document["nodes"] += [{"camera": 0, "scale": [2, 2, 2], "translation": [0, 1, 4]}, {"camera": 0}, {"camera": 1}]
    glb.document["scenes"] = [{"nodes": [0, 1, 2, 3]}]
    scene = imported(glb)
    assert [camera.name for camera in scene.cameras] == ["uber-kuche-1", "uber-kuche-1-2"]
    expected = np.eye(4)
    expected[:3, 3] = [0, 1, 4]
    np.testing.assert_allclose(scene.cameras[0].to_world, expected, atol=1e-12)
    assert (scene.cameras[0].yfov, scene.cameras[0].aspect) == (0.6, 1.5)
    assert any("only perspective" in warning for warning in scene.warnings)


def test_a_scene_without_camera_gets_a_framing_camera() -> None:
    glb = Glb().quad()
    glb.document["nodes"][0] |= {"scale": [7, 0.5, 1], "translation": [30, 2, -9]}
    scene = imported(glb)
    (camera,) = scene.cameras
    assert camera.name == "front"
    local = (scene.meshes[0].positions - camera.to_world[:3, 3]) @ camera.to_world[:3, :3]
    x, y = -local[:, 0] / local[:, 2], -local[:, 1] / local[:, 2]
    half_height = np.tan(camera.yfov / 2)
    assert (local[:, 2] < 0).all()
    assert np.abs(x).max() <= half_height * 4 / 3
    assert np.abs(y).max() <= half_height
    assert np.abs(x).max() > 0.5 * half_height * 4 / 3 or np.abs(y).max() > 0.5 * half_height


def test_each_unsupported_feature_gives_one_warning() -> None:
    glb = Glb()
    texture = {"index": glb.texture([[[9, 9, 9]]])}
    description = {
        "name": "Lamp",
        "occlusionTexture": texture,
        "extensions": {"KHR_materials_iridescence": {}},
    }
    glb.quad(description)
    glb.document |= {"animations": [{}], "skins": [{}]}
    glb.document["nodes"][0]["skin"] = 0
    warnings = imported(glb).warnings
    words = ["occlusion", "Iridescence", "1 animation was", "skin"]
    for word in words:
        assert len([warning for warning in warnings if word in warning]) == 1, word
    assert len(warnings) == len(words)
    assert len([warning for warning in warnings if "“Lamp”" in warning]) == 2


def test_equal_material_names_are_made_unique() -> None:
    glb = Glb().quad({"name": "Wood"})
    glb.document["materials"] *= 2
    primitives = glb.document["meshes"][0]["primitives"]
    primitives.append(primitives[0] | {"material": 1})
    assert [material.name for material in imported(glb).materials] == ["Wood", "Wood 2"]


def test_real_scenes_are_imported(shared_data: Path) -> None:
    names = re.compile(r"[a-z0-9-]{1,40}\Z")
    for path in sorted((shared_data / "scenes").rglob("*.gl[bt]*")):
        if path.name == "chess_set.gltf":  # is large
            continue
        scene = import_gltf(self_contained(path) if path.suffix == ".gltf" else path.read_bytes(), path.stem, LIGHT)
        assert scene.meshes, path
        assert all(names.match(camera.name) for camera in scene.cameras), path
        for mesh in scene.meshes:
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-4)
