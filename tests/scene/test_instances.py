"""Nodes that show their mesh in many places."""

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
    known = {name: glb.accessor(np.asarray(values, np.float32)) for name, values in attributes.items()}
    extension = {"EXT_mesh_gpu_instancing": {"attributes": known}}
    glb.document["nodes"][0] |= {"name": "tree", "extensions": extension, **(node or {})}
    return glb


def imported(glb: Glb) -> Scene:
    return import_gltf(glb.bytes(), "test", LIGHT)


def test_each_instance_is_moved_turned_and_scaled_inside_of_its_node() -> None:
    half = np.sqrt(0.5)
    scene = imported(
        instanced(
            {"translation": [0, 0, 5]},
            TRANSLATION=[[1, 2, 3], [0, 0, 0]],
            ROTATION=[[0, 0, half, half], [0, 0, 0, 1]],
            SCALE=[[1, 1, 1], [2, 3, 1]],
        )
    )
    turned, scaled = scene.meshes
    assert [mesh.name for mesh in scene.meshes] == ["tree", "tree 2"]
    np.testing.assert_allclose(turned.positions, QUAD[:, [1, 0, 2]] * [-1, 1, 1] + [1, 2, 8], atol=1e-6)
    np.testing.assert_allclose(scaled.positions, QUAD * [2, 3, 1] + [0, 0, 5], atol=1e-6)
    assert scene.warnings == ()


def test_attributes_that_are_not_known_are_not_read() -> None:
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
    corners = np.concatenate([one.positions[one.faces] for one in apart.meshes])
    np.testing.assert_array_equal(mesh.positions[mesh.faces], corners)


def test_instances_of_no_size_and_out_of_range_are_left_out_and_said() -> None:
    scene = imported(instanced(SCALE=[[1, 1, 1], [0, 1, 1], [np.nan, 1, 1], [1e20, 1, 1]]))
    assert len(scene.meshes) == 1
    assert any("Skipped 2 instances" in str(warning) for warning in scene.warnings)
    assert any("scale is zero" in str(warning) for warning in scene.warnings)


def test_instances_that_are_flattened_are_what_is_left_of_them() -> None:
    """By a scale of nothing along what has no extent; and the sides of a box, which fall onto its plane."""
    scene = imported(instanced(SCALE=[[1, 1, 0], [2, -3, 0]]))
    assert len(scene.meshes) == 2
    for mesh, scale in zip(scene.meshes, ([1, 1, 0], [2, -3, 0]), strict=True):
        np.testing.assert_allclose(mesh.positions, QUAD * scale, atol=1e-6)
        np.testing.assert_allclose(np.abs(mesh.normals), np.tile([0.0, 0.0, 1.0], (len(QUAD), 1)), atol=1e-6)
        assert len(mesh.faces) == 2
    assert [str(warning) for warning in scene.warnings] == [
        "2 meshes are flattened by the scale of their nodes, for example “tree”."
    ]


def test_a_matrix_of_any_rank_sends_normals_across_what_it_makes_of_planes() -> None:
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


def test_nodes_that_go_round_are_shown_once_and_said() -> None:
    glb = Glb().quad()
    glb.document["nodes"][0] |= {"name": "tree", "children": [1], "translation": [1, 0, 0]}
    glb.document["nodes"].append({"children": [0, 2], "translation": [0, 1, 0]})
    glb.document["nodes"].append({"children": [2, 1], "mesh": 0})
    scene = imported(glb)
    assert len(scene.meshes) == 2
    np.testing.assert_allclose(scene.meshes[1].positions, QUAD + np.array([1, 1, 0]), atol=1e-6)
    told = sorted(str(warning) for warning in scene.warnings)
    assert [warning.split(" has ")[0] for warning in told] == ["Node 0 “tree”", "Node 1", "Node 2"]
    assert all("several parents" in warning for warning in told)


@pytest.mark.parametrize("extension", [[], {"attributes": 3}, {"attributes": {"TRANSLATION": -1}}, {}])
def test_an_extension_that_is_not_valid_is_said(extension: object) -> None:
    glb = Glb().quad()
    glb.document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": extension}
    scene = imported(glb)
    assert len(scene.meshes) == 1
    assert any("are invalid" in str(warning) for warning in scene.warnings)


def test_instances_that_do_not_fit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SceneError, match="have 1 and 2 attribute values"):
        imported(instanced(TRANSLATION=[[0, 0, 0]], SCALE=[[1, 1, 1], [1, 1, 1]]))
    with pytest.raises(SceneError, match="not vectors of 3"):
        imported(instanced(TRANSLATION=[[0, 0], [1, 1]]))
    monkeypatch.setattr(importer, "MAX_INSTANCES", 3)
    with pytest.raises(SceneError, match="3 more are allowed"):
        imported(instanced(TRANSLATION=np.zeros((4, 3))))
