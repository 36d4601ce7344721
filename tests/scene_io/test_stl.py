"""STL, binary and text, against known arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.core.color import srgb_decode
from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene
from relume.scene_io.obj_ply.stl import FACET

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float32)


def binary(header: bytes = b"", attributes: tuple[int, int] = (0, 0), corners: np.ndarray = SQUARE) -> bytes:
    facets = np.zeros(2, FACET)
    facets["normal"], facets["corners"], facets["attribute"] = [0, 0, 1], corners, attributes
    return header.ljust(80, b"\0") + np.array(2, "<u4").tobytes() + facets.tobytes()


def text(name: str = "", end: str = "endsolid\n") -> bytes:
    facets = "".join(
        "  facet normal 0 0 1\n    outer loop\n"
        + "".join(f"      vertex {x} {y:e} {z}\n" for x, y, z in triangle)
        + "    endloop\n  endfacet\n"
        for triangle in SQUARE.tolist()
    )
    return f"solid {name}\n{facets}{end}".encode()


def imported(data: bytes) -> Scene:
    return import_scene(data, "test", LIGHT)


@pytest.mark.parametrize(
    "data",
    [
        binary(),
        binary(b"solid but binary"),
        text(),
        text("plate"),
        text().upper(),
        text().replace(b"\n", b"\r\n"),
        b"\xef\xbb\xbf" + text(),
        binary() + b"more",
    ],
    ids=["binary", "solid", "text", "named", "upper", "crlf", "mark", "longer"],
)
def test_binary_and_text_give_the_same_mesh(data: bytes) -> None:
    scene = imported(data)
    (mesh,) = scene.meshes
    np.testing.assert_array_equal(mesh.positions[mesh.faces], SQUARE)
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 6, atol=1e-6)
    assert scene.warnings == ()


def test_solids_are_meshes() -> None:
    assert [mesh.name for mesh in imported(text("plate") + text("lid")).meshes] == ["plate", "lid"]


def test_normals_are_averaged_over_triangles_with_a_common_edge() -> None:
    bent = SQUARE.copy()
    bent[1, 2, 2] = 0.3
    normals = imported(binary(corners=bent)).meshes[0].normals.reshape(2, 3, 3)
    np.testing.assert_allclose(normals[0, 0], normals[1, 0], atol=1e-6)
    assert normals[0, 0, 2] < 0.999


def colors(scene: Scene) -> np.ndarray:
    """Linear colors of the two triangles, (2, 3)."""
    (material,) = scene.materials
    if "diffuse" not in material.textures:
        return np.array([material.terms[0]["color"]] * 2)
    values = get_texture_values(material.textures["diffuse"])
    height, width = values.shape[:2]
    texels = np.floor(scene.meshes[0].uvs[[0, 3]] * [width, height]).astype(int)
    return np.array([values[v, u] for u, v in texels])


def test_colors_of_viscam_are_read() -> None:
    red, gray = 0x8000 | 31 << 10, 0
    scene = imported(binary(b"by VisCAM", (red, gray)))
    expected = [[1, 0, 0], srgb_decode(np.full(3, 0.8, np.float32))]
    np.testing.assert_allclose(colors(scene), expected, atol=0.01)
    assert scene.warnings == ()


def test_colors_of_materialise_magics_are_read() -> None:
    red, default = 31, 0x8000
    header = b"COLOR=" + bytes([0, 255, 0, 255]) + b",MATERIAL="
    np.testing.assert_allclose(colors(imported(binary(header, (red, default)))), [[1, 0, 0], [0, 1, 0]], atol=0.01)


def test_truncated_files_have_their_complete_triangles() -> None:
    for data in (binary()[:-10], text(end="").rpartition(b"    endloop")[0]):
        scene = imported(data)
        assert len(scene.meshes[0].faces) == 1
        assert "ends early" in scene.warnings[0]
        assert scene.warnings[0].severity == "unsupported"


def test_triangles_that_are_incomplete_or_no_numbers_are_left_out() -> None:
    scene = imported(text().replace(b"      vertex 0.0 1.000000e+00 0.0\n", b""))
    assert len(scene.meshes[0].faces) == 1
    assert "triangle 2 (“2 vertices”)" in scene.warnings[0]
    broken = SQUARE.copy()
    broken[1, 0, 0] = np.nan
    scene = imported(binary(corners=broken))
    assert len(scene.meshes[0].faces) == 1
    assert "not numbers" in scene.warnings[0]


@pytest.mark.parametrize(
    "data",
    [
        b"solid\nendsolid\n",
        binary()[:84],
        b"solid",
        b"\1" * 300,
        np.random.default_rng(3).bytes(5_000),
        bytes(80) + b"\xff\xff\xff\xff" + bytes(200),
        binary(corners=np.zeros((2, 3, 3))),
    ],
)
def test_files_without_triangles_are_refused(data: bytes) -> None:
    with pytest.raises(SceneError):
        imported(data)


def test_real_files_are_imported_or_refused(shared_data: Path) -> None:
    for path in sorted((shared_data / "bad-inputs" / "trimesh").rglob("*.stl")):
        with pytest.raises(SceneError, match="no triangles"):
            import_scene(path, path.stem, LIGHT)
