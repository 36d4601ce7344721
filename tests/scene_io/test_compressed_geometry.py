"""Geometry decoded from Draco and meshoptimizer equals the encoded geometry."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from packed_glb import GRID_FACES, VECTORS, draco_glb, grid, meshopt_glb

from relume.assets.environments.environment import Environment
from relume.scene.model import Mesh
from relume.scene_io.gltf import import_gltf
from relume.scene_io.meshopt import FILTERS, decode_sequence, decode_triangles, decode_vertices

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))


def corners(mesh: Mesh) -> set[tuple[tuple[float, ...], ...]]:
    """Each triangle as its vertices in canonical order."""
    points = np.round(mesh.positions[mesh.faces], 3).tolist()
    return {min(tuple(tuple(p[(i + k) % 3]) for k in range(3)) for i in range(3)) for p in points}


def expected() -> set[tuple[tuple[float, ...], ...]]:
    positions, uvs, faces = grid()
    flat = np.zeros_like(positions)
    return corners(Mesh("grid", positions, flat, np.zeros((len(flat), 4), np.float32), uvs, faces, 0))


@pytest.mark.parametrize("level", [0, 1, 7, 10])
def test_draco_preserves_triangles_and_uv_coordinates(level: int) -> None:
    (mesh,) = import_gltf(draco_glb(level=level).bytes(), "test", LIGHT).meshes
    assert corners(mesh) == expected()
    np.testing.assert_allclose(mesh.uvs, mesh.positions[:, :2] / [6, 3], atol=2e-3)


def test_draco_is_ignored_if_plain_data_exists() -> None:
    glb = draco_glb(b"no Draco at all")
    positions, uvs, faces = grid()
    plain = [glb.accessor(values) for values in (positions, uvs, faces.reshape(-1))]
    primitive = glb.document["meshes"][0]["primitives"][0]
    primitive |= {"attributes": {"POSITION": plain[0], "TEXCOORD_0": plain[1]}, "indices": plain[2]}
    glb.document["extensionsRequired"] = []
    (mesh,) = import_gltf(glb.bytes(), "test", LIGHT).meshes
    assert corners(mesh) == expected()


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_meshopt_preserves_triangles_and_normals(name: str) -> None:
    scene = import_gltf(meshopt_glb(name).bytes(), "test", LIGHT)
    (mesh,) = scene.meshes
    assert corners(mesh) == expected()
    assert len(mesh.faces) == GRID_FACES
    np.testing.assert_allclose(mesh.normals, np.broadcast_to([0, 0, 1], mesh.normals.shape), atol=1e-6)
    assert scene.warnings == ()


@pytest.mark.parametrize("name", VECTORS)
def test_meshopt_decoding_equals_its_reference(name: str) -> None:
    vector = VECTORS[name]
    packed, count, stride = base64.b64decode(vector["packed"]), vector["count"], vector["stride"]
    plain = np.frombuffer(base64.b64decode(vector["plain"]), np.uint8)
    if vector["mode"] == "ATTRIBUTES":
        decoded = FILTERS[vector["filter"]](decode_vertices(packed, count, stride)).reshape(-1)
    else:
        decode = decode_triangles if vector["mode"] == "TRIANGLES" else decode_sequence
        decoded = decode(packed, count).astype(f"<u{stride}").view(np.uint8)
    if vector["filter"] == "OCTAHEDRAL":  # halves round to even here, and up in the reference
        kind = "i1" if stride == 4 else "<i2"
        assert np.abs(decoded.view(kind).astype(int) - plain.view(kind)).max() <= 1
    else:
        np.testing.assert_array_equal(decoded, plain)
