"""Absurd accessors, meshes and node trees are rejected before allocation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import QUAD, Glb, pack
from hostile_scenes import changed, imported, rejected, with_accessor

from relume.scene_io.gltf import importer


@pytest.mark.parametrize(
    "changes",
    [
        {"count": 2**31},
        {"count": 10**30},
        {"count": -1},
        {"count": 0},
        {"count": 5},
        {"byteOffset": 2**39},
        {"byteOffset": 10**40},
        {"bufferView": 99},
        {"type": "MAT4"},
        {"type": "VEC9"},
        {"componentType": 5124},
        {"bufferView": None, "count": 4_000_000_000},
        {"sparse": {"count": 10**9, "indices": {"bufferView": 1, "componentType": 5125}, "values": {"bufferView": 0}}},
    ],
)
def test_import_refuses_absurd_accessors(changes: dict[str, Any]) -> None:
    rejected(with_accessor(**changes))


def test_import_refuses_zeros_without_data_that_claim_gigabytes() -> None:
    sparse = {"count": 1, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 0}}
    glb = Glb().quad()
    glb.document["accessors"][0] = {"componentType": 5126, "count": 70_000_000, "type": "VEC3", "sparse": sparse}
    rejected(glb.bytes())


def test_import_refuses_views_that_reach_beyond_their_buffer() -> None:
    glb = Glb().quad()
    glb.document["bufferViews"][0]["byteLength"] = 10**9
    assert "exceeds its buffer" in rejected(glb.bytes())


@pytest.mark.parametrize("stride", [4, 8, 253, 10**9])
def test_import_refuses_strides_that_do_not_fit(stride: int) -> None:
    glb = Glb().quad()
    glb.document["bufferViews"][0]["byteStride"] = stride
    rejected(glb.bytes())


def test_import_refuses_indices_out_of_range() -> None:
    glb = Glb().quad()
    glb.document["meshes"][0]["primitives"][0]["indices"] = glb.accessor(np.array([0, 1, 40_000], np.uint16))
    assert "beyond its 4 vertices" in rejected(glb.bytes())


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
def test_import_refuses_positions_that_are_not_finite(value: float) -> None:
    positions = QUAD.copy()
    positions[2, 1] = value
    assert "NaN, infinite or huge" in rejected(Glb().quad(POSITION=positions).bytes())


def test_import_refuses_a_mesh_without_triangles() -> None:
    glb = Glb().quad()
    glb.document["meshes"][0]["primitives"][0]["mode"] = 1
    assert "no triangles" in rejected(glb.bytes())


def test_import_refuses_a_file_without_meshes() -> None:
    assert "no triangles" in rejected(pack({"asset": {"version": "2.0"}}, b""))


def test_import_drops_degenerate_triangles_with_a_warning() -> None:
    glb = Glb().quad()
    corners = np.array([0, 1, 2, 1, 1, 2, 3, 3, 3], np.uint16)
    glb.document["meshes"][0]["primitives"][0]["indices"] = glb.accessor(corners)
    scene = imported(glb.bytes())
    assert len(scene.meshes[0].faces) == 1
    assert any("Removed 2 zero-area triangles" in warning for warning in scene.warnings)


def test_import_refuses_a_mesh_of_degenerate_triangles_only() -> None:
    assert "no triangles" in rejected(Glb().quad(POSITION=np.zeros((4, 3), np.float32)).bytes())


@pytest.mark.parametrize(
    "nodes",
    [
        [{"mesh": 0, "matrix": [1e30] * 16}],
        [{"mesh": 3}],
        [{"camera": 3}],
        [{"children": [7]}],
        [{"mesh": 0}] * 100_001,
    ],
)
def test_import_refuses_missing_nodes(nodes: list[dict[str, Any]]) -> None:
    said = rejected(changed(nodes=nodes))
    assert len(nodes) < 100_000 or "more than 100,000 nodes" in said


@pytest.mark.parametrize(
    "nodes",
    [
        [{"children": [0], "mesh": 0}],
        [{"children": [1]}, {"children": [0], "mesh": 0}],
        [{"children": [1, 1]}, {"mesh": 0}],
        [{"children": [0] * 50_000, "mesh": 0}],
    ],
)
def test_nodes_of_an_invalid_tree_appear_once_with_one_warning(nodes: list[dict[str, Any]]) -> None:
    scene = imported(changed(nodes=nodes))
    assert len(scene.meshes) == 1
    assert len([warning for warning in scene.warnings if "several parents" in warning]) == 1


def test_import_refuses_too_many_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importer, "MAX_INSTANCES", 2_000)
    glb = Glb().quad()
    glb.document["meshes"][0]["primitives"] *= 1_000
    glb.document["nodes"] = [{"mesh": 0}] * 3
    glb.document["scenes"] = [{"nodes": list(range(3))}]
    assert "2,000 meshes" in rejected(glb.bytes())


def test_import_refuses_too_many_degenerate_triangles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importer, "MAX_CORNERS", 600)
    glb = Glb().quad()
    primitive = glb.document["meshes"][0]["primitives"][0]
    primitive["indices"] = glb.accessor(np.zeros(300, np.uint16))
    glb.document["meshes"][0]["primitives"] = [primitive] * 3
    assert "triangles" in rejected(glb.bytes())
