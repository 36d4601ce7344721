"""PLY, text and binary, against known arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from glb_builder import DIELECTRIC_TRANSMISSION
from ply_builder import POSITIONS, binary, text

from relume.assets.environments.environment import Environment
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))


def imported(data: bytes) -> Scene:
    return import_scene(data, "test", LIGHT)


@pytest.mark.parametrize("data", [text(), binary("<"), binary(">")], ids=["text", "little", "big"])
@pytest.mark.parametrize("mixed", [False, True])
def test_all_formats_give_the_same_mesh(data: bytes, mixed: bool) -> None:
    if mixed:  # a triangle after the quad: rows of different lengths
        data = {b"asc": text(True), b"bin": binary("<", True)}[data.split()[2][:3]]
    (mesh,) = imported(data).meshes
    expected = POSITIONS[[0, 1, 2, 0, 2, 3, *([0, 1, 3] if mixed else [])]]
    np.testing.assert_array_equal(mesh.positions, expected.astype(np.float32))
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * len(expected), atol=1e-6)


def test_normals_uvs_and_colors_are_read() -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(
        f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "s", "t")
    )
    header += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    header += "element face 1\nproperty uchar flags\nproperty list uchar uint vertex_index\nend_header\n"
    rows = "0 0 0 0 3 4 0 0 255 0 128\n1 0 0 0 3 4 1 0 255 0 128\n0 1 0 0 3 4 0 1 255 0 128\n7 3 0 1 2\n"
    scene = imported((header + rows).encode())
    mesh = scene.meshes[0]
    np.testing.assert_allclose(mesh.normals, [[0, 0.6, 0.8]] * 3, atol=1e-6)
    np.testing.assert_array_equal(mesh.uvs, [[0, 1], [1, 1], [0, 0]])
    np.testing.assert_allclose(
        scene.materials[0].terms[0]["color"], np.array([1, 0, 0.2158605]) * DIELECTRIC_TRANSMISSION, atol=1e-6
    )
    assert scene.warnings == ()


def test_real_files_are_imported(shared_data: Path) -> None:
    files = sorted((shared_data / "scenes" / "meshes").glob("*.ply"))
    assert len(files) > 3
    for path in files:
        (mesh,) = import_scene(path, path.stem, LIGHT).meshes
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-4)
