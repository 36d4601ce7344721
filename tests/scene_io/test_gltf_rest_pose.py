"""Skins and morph targets of glTF files in the rest pose, by the specification's formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
from glb_builder import QUAD, Glb

from relume.assets.environments.environment import Environment
from relume.scene.model import Scene
from relume.scene_io.gltf import import_gltf

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
FIRST = np.tile(np.array([[1, 0, 0, 0]], np.float32), (4, 1))


def imported(glb: Glb) -> Scene:
    return import_gltf(glb.bytes(), "test", LIGHT)


def skinned(joints: list[dict[str, Any]], weights: np.ndarray = FIRST, inverse: np.ndarray | None = None) -> Glb:
    """A quad whose corners follow joints 0 to 3, with a node that is far away."""
    indices = np.tile(np.arange(4, dtype=np.uint8), (4, 1)) % len(joints)
    glb = Glb().quad(JOINTS_0=indices, WEIGHTS_0=weights.astype(np.float32))
    skin: dict[str, Any] = {"joints": list(range(1, len(joints) + 1))}
    if inverse is not None:
        # column by column
        columns = inverse.transpose(0, 2, 1).reshape(-1, 4).astype(np.float32)
        skin["inverseBindMatrices"] = glb.accessor(columns, count=len(inverse), type="MAT4")
    glb.document["nodes"] = [{"mesh": 0, "skin": 0, "translation": [100, 0, 0]}, *joints]
    glb.document["scenes"] = [{"nodes": list(range(len(joints) + 1))}]
    glb.document["skins"] = [skin]
    return glb


def test_vertices_follow_their_joint_and_not_their_node() -> None:
    scene = imported(skinned([{"scale": [0.01] * 3, "translation": [0, 5, 0]}], inverse=np.eye(4)[None]))
    (mesh,) = scene.meshes
    np.testing.assert_allclose(mesh.positions + scene.offset, QUAD * 0.01 + [0, 5, 0], atol=1e-6)
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 4, atol=1e-6)


def test_inverse_bind_matrices_apply_first() -> None:
    bind = np.eye(4)
    bind[:3, 3] = [1, 2, 3]
    bind[0, 0] = 2
    half = np.sqrt(0.5)
    turned = {"rotation": [0, 0, half, half], "translation": [0, 0, 10]}
    (mesh,) = imported(skinned([turned], inverse=bind[None])).meshes
    moved = QUAD * [2, 1, 1] + [1, 2, 3]
    np.testing.assert_allclose(mesh.positions, np.stack([-moved[:, 1], moved[:, 0], moved[:, 2] + 10], -1), atol=1e-5)


def test_weights_blend_joints_and_sum_to_one() -> None:
    weights = np.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [2, 6, 0, 0], [0, 0, 0, 0]])
    (mesh,) = imported(skinned([{}, {"translation": [0, 0, 8]}], weights)).meshes
    np.testing.assert_allclose(mesh.positions - QUAD, [[0, 0, 0], [0, 0, 4], [0, 0, 6], [0, 0, 0]], atol=1e-6)


def test_mirrored_joints_flip_faces() -> None:
    (mesh,) = imported(skinned([{"scale": [-1, 1, 1]}])).meshes
    a, b, c = mesh.positions[mesh.faces[0]]
    np.testing.assert_allclose(np.cross(b - a, c - a), mesh.normals[0], atol=1e-6)
    np.testing.assert_allclose(mesh.normals[0], [0, 0, 1], atol=1e-6)


def test_normals_follow_the_inverse_transpose_of_their_joint() -> None:
    glb = skinned([{"scale": [2, 1, 1]}])
    slanted = glb.accessor(np.tile(np.array([[0.6, 0, 0.8]], np.float32), (4, 1)))
    glb.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = slanted
    np.testing.assert_allclose(
        imported(glb).meshes[0].normals[0], np.array([0.3, 0, 0.8]) / np.hypot(0.3, 0.8), atol=1e-6
    )


def test_joints_outside_the_scene_are_used() -> None:
    glb = skinned([{"translation": [0, 1, 0]}])
    glb.document["nodes"].append({"children": [1], "translation": [0, 0, 7]})
    glb.document["scenes"] = [{"nodes": [0]}]
    np.testing.assert_allclose(imported(glb).meshes[0].positions, QUAD + np.array([0, 1, 7]))


def test_a_skin_that_cannot_be_read_shows_the_mesh_at_its_node() -> None:
    glb = skinned([{}])
    glb.document["skins"][0]["joints"] = [9]
    scene = imported(glb)
    np.testing.assert_allclose(scene.meshes[0].positions, QUAD + np.array([100, 0, 0]))
    assert any("A skin was left out" in warning for warning in scene.warnings)


def test_one_mesh_with_two_skins_is_shown_twice() -> None:
    glb = skinned([{"translation": [0, 1, 0]}, {"translation": [0, 2, 0]}])
    glb.document["skins"] = [{"joints": [1]}, {"joints": [2]}]
    glb.document["nodes"].append({"mesh": 0, "skin": 1})
    glb.document["scenes"][0]["nodes"].append(3)
    meshes = imported(glb).meshes
    assert [mesh.positions[0, 1] for mesh in meshes] == [1, 2]


def morphed(**nodes: Any) -> Glb:
    """A quad with a target that lifts it by 3, and one that moves its last corner."""
    glb = Glb().quad()
    lift, corner = np.tile(np.array([[0, 0, 3]], np.float32), (4, 1)), np.zeros((4, 3), np.float32)
    corner[2] = [1, 1, 0]
    slant = np.tile(np.array([[1, 0, 0]], np.float32), (4, 1))
    targets = [{"POSITION": glb.accessor(lift)}, {"POSITION": glb.accessor(corner), "NORMAL": glb.accessor(slant)}]
    glb.document["meshes"][0]["primitives"][0]["targets"] = targets
    return glb


def test_the_default_weights_of_a_mesh_morph_it() -> None:
    glb = morphed()
    glb.document["meshes"][0]["weights"] = [1, 0]
    scene = imported(glb)
    np.testing.assert_allclose(scene.meshes[0].positions, QUAD + np.array([0, 0, 3]))
    assert scene.warnings == ()


def test_weights_of_a_node_override_those_of_its_mesh() -> None:
    glb = morphed()
    glb.document["meshes"][0]["weights"] = [1, 0]
    glb.document["nodes"] += [{"mesh": 0, "weights": [0.5, 1]}, {"mesh": 0, "weights": [0, 0]}]
    glb.document["scenes"][0]["nodes"] += [1, 2]
    lifted, mixed, plain = imported(glb).meshes
    np.testing.assert_allclose(lifted.positions[:, 2], 3)
    displacements = np.array([[0, 0, 1.5], [0, 0, 1.5], [1, 1, 1.5], [0, 0, 1.5]])
    np.testing.assert_allclose(mixed.positions, QUAD + displacements)
    np.testing.assert_allclose(mixed.normals, np.tile(np.sqrt([0.5, 0, 0.5]), (4, 1)), atol=1e-6)
    np.testing.assert_allclose(plain.positions, QUAD)


def test_targets_that_do_not_fit_are_left_out() -> None:
    glb = morphed()
    glb.document["meshes"][0]["weights"] = [1, 1]
    glb.document["meshes"][0]["primitives"][0]["targets"][1] = {"POSITION": glb.accessor(QUAD[:2])}
    scene = imported(glb)
    np.testing.assert_allclose(scene.meshes[0].positions, QUAD + np.array([0, 0, 3]))
    assert any("2 displacements" in warning for warning in scene.warnings)


def test_displacements_without_data_are_zero() -> None:
    glb = morphed()
    glb.document["meshes"][0]["weights"] = [1, 1]
    glb.document["accessors"].append({"count": 4, "componentType": 5126, "type": "VEC3"})
    glb.document["meshes"][0]["primitives"][0]["targets"][1] = {"POSITION": len(glb.document["accessors"]) - 1}
    np.testing.assert_allclose(imported(glb).meshes[0].positions, QUAD + np.array([0, 0, 3]))


def test_morphing_precedes_skinning() -> None:
    glb = skinned([{"translation": [0, 5, 0], "scale": [2, 2, 2]}])
    lift = glb.accessor(np.tile(np.array([[0, 0, 3]], np.float32), (4, 1)))
    glb.document["meshes"][0] |= {"weights": [1]}
    glb.document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": lift}]
    expected = (QUAD + np.array([0, 0, 3])) * 2 + np.array([0, 5, 0])
    np.testing.assert_allclose(imported(glb).meshes[0].positions, expected, atol=1e-6)
