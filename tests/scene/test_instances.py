"""Nodes that show their mesh in many places."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import QUAD, Glb

from relume.environments.model import Environment
from relume.errors import SceneError
from relume.scene.gltf import import_gltf, importer
from relume.scene.model import Scene

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
    monkeypatch.setattr(importer, "_MANY", 10)
    (mesh,) = imported(instanced(TRANSLATION=moves)).meshes
    assert mesh.name == "tree"
    for name in ("positions", "normals", "tangents", "uvs"):
        np.testing.assert_array_equal(getattr(mesh, name), np.concatenate([getattr(m, name) for m in apart.meshes]))
    corners = np.concatenate([one.positions[one.faces] for one in apart.meshes])
    np.testing.assert_array_equal(mesh.positions[mesh.faces], corners)


def test_instances_of_no_size_and_out_of_range_are_left_out_and_said() -> None:
    scene = imported(instanced(SCALE=[[1, 1, 1], [0, 1, 1], [np.nan, 1, 1], [1e20, 1, 1]]))
    assert len(scene.meshes) == 1
    assert any("2 of the instances" in str(warning) for warning in scene.warnings)
    assert any("scaled to nothing" in str(warning) for warning in scene.warnings)


@pytest.mark.parametrize("extension", [[], {"attributes": 3}, {"attributes": {"TRANSLATION": -1}}, {}])
def test_an_extension_that_is_not_valid_is_said(extension: object) -> None:
    glb = Glb().quad()
    glb.document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": extension}
    scene = imported(glb)
    assert len(scene.meshes) == 1
    assert any("not valid" in str(warning) for warning in scene.warnings)


def test_instances_that_do_not_fit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SceneError, match="have attributes of 1 and of 2"):
        imported(instanced(TRANSLATION=[[0, 0, 0]], SCALE=[[1, 1, 1], [1, 1, 1]]))
    with pytest.raises(SceneError, match="give vectors of 3"):
        imported(instanced(TRANSLATION=[[0, 0], [1, 1]]))
    monkeypatch.setattr(importer, "MAX_PLACED", 3)
    with pytest.raises(SceneError, match="3 more are allowed"):
        imported(instanced(TRANSLATION=np.zeros((4, 3))))
