"""Nodes with instances of their mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import QUAD, Glb

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.gltf import import_gltf, importer
from relume.scene_io.gltf.degenerate_transforms import cofactors, count_dimensions

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))


def instanced(node: dict[str, Any] | None = None, **attributes: Any) -> Glb:
    glb = Glb().quad()
    accessors = {name: glb.accessor(np.asarray(values, np.float32)) for name, values in attributes.items()}
    extension = {"EXT_mesh_gpu_instancing": {"attributes": accessors}}
    glb.document["nodes"][0] |= {"name": "tree", "extensions": extension, **(node or {})}
    return glb


def imported(glb: Glb) -> Scene:
    return import_gltf(glb.bytes(), "test", LIGHT)


def test_instance_transforms_are_relative_to_their_node() -> None:
    half = np.sqrt(0.5)
    scene = imported(
        instanced(
            {"translation": [0, 0, 5]},
            TRANSLATION=[[1, 2, 3], [0, 0, 0]],
            ROTATION=[[0, 0, half, half], [0, 0, 0, 1]],
            SCALE=[[1, 1, 1], [2, 3, 1]],
        )
    )
    rotated, scaled = scene.meshes
    assert [mesh.name for mesh in scene.meshes] == ["tree", "tree 2"]
    np.testing.assert_allclose(rotated.positions, QUAD[:, [1, 0, 2]] * [-1, 1, 1] + [1, 2, 8], atol=1e-6)
    np.testing.assert_allclose(scaled.positions, QUAD * [2, 3, 1] + [0, 0, 5], atol=1e-6)
    assert scene.warnings == ()


def test_unknown_attributes_are_not_read() -> None:
    glb = instanced(TRANSLATION=[[0, 0, 0], [2, 0, 0]], _ID=[1.0, 2.0])
    assert len(imported(glb).meshes) == 2
    assert len(imported(instanced(_ID=[1.0, 2.0])).meshes) == 1


def test_many_meshes_of_one_material_are_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    moves = np.column_stack([np.arange(50), np.zeros((50, 2))])
    apart = imported(instanced(TRANSLATION=moves))
    monkeypatch.setattr(importer, "_MAX_SEPARATE_MESHES", 10)
    (mesh,) = imported(instanced(TRANSLATION=moves)).meshes
    assert mesh.name == "tree"
    for name in ("positions", "normals", "tangents", "uvs"):
        np.testing.assert_array_equal(getattr(mesh, name), np.concatenate([getattr(m, name) for m in apart.meshes]))
    corners = np.concatenate([scene_mesh.positions[scene_mesh.faces] for scene_mesh in apart.meshes])
    np.testing.assert_array_equal(mesh.positions[mesh.faces], corners)


def test_invalid_instances_are_omitted_with_a_warning() -> None:
    scene = imported(instanced(SCALE=[[1, 1, 1], [0, 1, 1], [np.nan, 1, 1], [1e20, 1, 1]]))
    assert len(scene.meshes) == 1
    assert any("Skipped 2 instances" in str(warning) for warning in scene.warnings)
    assert any("scale is zero" in str(warning) for warning in scene.warnings)


def test_flattened_instances_keep_their_remaining_geometry() -> None:
    """Scaled by zero along an axis without extent; and the sides of a box, which collapse into its plane."""
    scene = imported(instanced(SCALE=[[1, 1, 0], [2, -3, 0]]))
    assert len(scene.meshes) == 2
    for mesh, scale in zip(scene.meshes, ([1, 1, 0], [2, -3, 0]), strict=True):
        np.testing.assert_allclose(mesh.positions, QUAD * scale, atol=1e-6)
        np.testing.assert_allclose(np.abs(mesh.normals), np.tile([0.0, 0.0, 1.0], (len(QUAD), 1)), atol=1e-6)
        assert len(mesh.faces) == 2
    assert [str(warning) for warning in scene.warnings] == [
        "2 meshes are flattened by the scale of their nodes, for example “tree”."
    ]


def test_normals_stay_perpendicular_for_matrices_of_any_rank() -> None:
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for scales in ([1.0, 2.0, 3.0], [1.0, 2.0, 0.0], [1e-6, 2e-6, 3e-6]):
        linear = turn * scales
        assert count_dimensions(linear) == np.count_nonzero(scales)
        normal, edges = cofactors(linear) @ [0.2, 0.3, 0.9], linear @ [[0.9, 0], [0, 0.3], [-0.2, -0.1]]
        assert np.linalg.norm(normal) > 0
        np.testing.assert_allclose(normal / np.linalg.norm(normal) @ (edges / np.linalg.norm(edges)), 0, atol=1e-9)
    for scales in ([1.0, 1e-12, 0.0], [0.0, 0.0, 0.0], [1e-20, 1e-20, 1e-20]):
        assert count_dimensions(turn * scales) < 2


def test_cyclic_nodes_are_shown_once_with_a_warning() -> None:
    glb = Glb().quad()
    glb.document["nodes"][0] |= {"name": "tree", "children": [1], "translation": [1, 0, 0]}
    glb.document["nodes"].append({"children": [0, 2], "translation": [0, 1, 0]})
    glb.document["nodes"].append({"children": [2, 1], "mesh": 0})
    scene = imported(glb)
    assert len(scene.meshes) == 2
    np.testing.assert_allclose(scene.meshes[1].positions, QUAD + np.array([1, 1, 0]), atol=1e-6)
    messages = sorted(str(warning) for warning in scene.warnings)
    assert [warning.split(" has ")[0] for warning in messages] == ["Node 1", "Node 2", "Node “tree”"]
    assert all("several parents" in warning for warning in messages)


@pytest.mark.parametrize("extension", [3, {"attributes": 3}, {}])
def test_an_invalid_instancing_extension_gives_a_warning(extension: object) -> None:
    glb = Glb().quad()
    glb.document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": extension}
    scene = imported(glb)
    assert len(scene.meshes) == 1
    assert any("are invalid" in str(warning) for warning in scene.warnings)


@pytest.mark.parametrize(
    ("attributes", "reason"),
    [
        ({"TRANSLATION": [[0, 0, 0]], "SCALE": [[1, 1, 1], [1, 1, 1]]}, "have 1 and 2 attribute values"),
        ({"TRANSLATION": [[0, 0], [1, 1]]}, "not vectors of 3"),
    ],
)
def test_instances_that_do_not_match_are_left_out(attributes: dict[str, Any], reason: str) -> None:
    scene = imported(instanced(**attributes))
    assert len(scene.meshes) == 1
    assert any(reason in warning for warning in scene.warnings)


def test_too_many_instances_are_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importer, "MAX_INSTANCES", 3)
    with pytest.raises(SceneError, match="3 more are allowed"):
        imported(instanced(TRANSLATION=np.zeros((4, 3))))
