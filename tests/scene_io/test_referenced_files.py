"""A scene file and the files uploaded with it."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from texture_values import get_texture_values

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene_io import referenced_files
from relume.scene_io.import_scene import import_scene
from relume.scene_io.referenced_files import UploadedFiles

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
TRIANGLE = b"mtllib ../looks/red.mtl\nusemtl Red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def uploaded(folder: Path, **files: bytes) -> dict[str, Path]:
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return {name: folder / name for name in files}


def test_names_are_resolved_in_the_upload_not_on_disk(tmp_path: Path) -> None:
    (path,) = uploaded(tmp_path, companion=b"newmtl Red\nKd 1 0 0\n").values()
    outgoing = UploadedFiles({"room\\looks\\Red.MTL": path}, "room/meshes/triangle.obj")
    scene = import_scene(TRIANGLE, "test", LIGHT, outgoing)
    assert scene.materials[0].terms[0]["color"] == [1, 0, 0]
    assert scene.warnings == ()


def test_a_file_that_was_not_uploaded_is_missing_even_if_it_is_on_disk(tmp_path: Path) -> None:
    uploaded(tmp_path, companion=b"newmtl Red\nKd 1 0 0\n")
    outgoing = UploadedFiles({}, "meshes/triangle.obj")
    missing = import_scene(TRIANGLE.replace(b"../looks/red.mtl", b"companion"), "test", LIGHT, outgoing)
    assert any("Missing material file" in warning for warning in missing.warnings)
    outside = import_scene(TRIANGLE.replace(b"../looks", b"../../../etc"), "test", LIGHT, outgoing)
    assert any("outside the scene's folder" in warning for warning in outside.warnings)
    assert outside.materials[0].terms[0]["color"] != [1, 0, 0]


@pytest.mark.parametrize("name", ["LOOKS/Größe.mtl", "looks/Gro\u0308ße.MTL"])
def test_names_differ_in_case_and_in_unicode_forms(tmp_path: Path, name: str) -> None:
    (tmp_path / "Looks").mkdir()
    (tmp_path / "Looks" / "größe.mtl").write_bytes(b"newmtl Red\nKd 1 0 0\n")
    (tmp_path / "a.obj").write_bytes(TRIANGLE.replace(b"../looks/red.mtl", name.encode()))
    scene = import_scene(tmp_path / "a.obj", "test", LIGHT)
    assert scene.materials[0].terms[0]["color"] == [1, 0, 0]
    assert scene.warnings == ()


@pytest.mark.parametrize("image", ["../images/red.png", "looks/red.png"])
def test_images_are_relative_to_the_material_file_or_to_the_scene(tmp_path: Path, image: str) -> None:
    """Real files use both for material files in a subfolder."""
    picture = io.BytesIO()
    Image.new("RGB", (2, 2), (255, 0, 0)).save(picture, "PNG")
    files = uploaded(
        tmp_path, scene=b"", looks=f"newmtl Red\nKd 1 1 1\nmap_Kd {image}\n".encode(), png=picture.getvalue()
    )
    lies = {"../images/red.png": "room/images/red.png", "looks/red.png": "room/looks/red.png"}[image]
    outgoing = UploadedFiles({"room/looks/red.mtl": files["looks"], lies: files["png"]}, "room/triangle.obj")
    scene = import_scene(TRIANGLE.replace(b"../looks", b"looks"), "test", LIGHT, outgoing)
    np.testing.assert_allclose(get_texture_values(scene.materials[0].textures["diffuse"])[0, 0], [1, 0, 0], atol=1e-3)


def test_the_total_size_of_files_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(referenced_files, "MAX_BYTES", 5)
    files = uploaded(tmp_path, a=b"1234", b=b"12")
    with pytest.raises(SceneError, match="scale them down"):
        UploadedFiles(files, "scene.obj")
