"""`--root`: files that a scene names by "../", below a folder that the user names."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from relume.core.errors import SceneError
from relume.scene_io.referenced_files import Folder
from relume_cli.main import main

OBJ = "mtllib ../looks/m.mtl\nusemtl Red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene in `meshes` with its material file in `looks`, and its image in `maps`."""
    monkeypatch.setenv("RELUME_DATA", str(tmp_path / "data"))
    project = tmp_path / "my project"
    for name in ("meshes", "looks", "maps"):
        (project / name).mkdir(parents=True)
    (project / "meshes" / "a.obj").write_text(OBJ)
    (project / "looks" / "m.mtl").write_text("newmtl Red\nKd 1 1 1\nmap_Kd ../maps/red.png\n")
    PIL.Image.fromarray(np.full((2, 2, 3), (255, 0, 0), np.uint8)).save(project / "maps" / "red.png")
    return project


def test_files_below_the_root_are_read(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(project / "meshes" / "a.obj"), "--root", str(project), "--json"]) == 0
    captured = capsys.readouterr()
    (material,) = json.loads(captured.out)["materials"]
    assert material["textures"]["diffuse"]["size"] == [2, 2]
    assert json.loads(captured.out)["warnings"] == []
    assert "--root" not in captured.err


def test_the_warnings_end_with_the_root_to_give(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(project / "meshes" / "a.obj"), "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["materials"][0]["textures"] == {}
    assert f"--root '{project}' also reads the files outside the scene's folder" in captured.err.splitlines()


def test_an_error_ends_with_the_root_to_give(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = {"asset": {"version": "2.0"}, "buffers": [{"uri": "../looks/m.mtl", "byteLength": 4}]}
    document |= {"bufferViews": [{"buffer": 0, "byteLength": 4}], "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
    document["accessors"] = [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}]
    document["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}}]}]
    (project / "meshes" / "a.gltf").write_text(json.dumps(document))
    assert main(["import", str(project / "meshes" / "a.gltf")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(f"; --root '{project}' also reads the files outside the scene's folder")


def test_missing_and_absolute_files_need_no_root(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    secret = project / "looks" / "m.mtl"
    for name in ("../nowhere/m.mtl", str(secret), "http://host/../m.mtl", "../../../../../../../x\\0.mtl"):
        (project / "meshes" / "a.obj").write_text(OBJ.replace("../looks/m.mtl", name))
        assert main(["import", str(project / "meshes" / "a.obj")]) == 0
        assert "--root" not in capsys.readouterr().err


def test_nothing_outside_the_root_is_read(project: Path) -> None:
    (project.parent / "secret.mtl").write_text("secret")
    (project / "maps" / "link.mtl").symlink_to(project.parent / "secret.mtl")
    (project / "linked").symlink_to(project.parent)
    files = Folder(project / "meshes", project)
    assert files.read("../looks/../looks/m.mtl", "x") is not None
    for name in (
        "../../secret.mtl",
        "../maps/link.mtl",
        "../linked/secret.mtl",
        "/etc/hostname",
        "../..",
        "..\\..\\secret.mtl",
    ):
        with pytest.raises(SceneError):
            files.read(name, "x")
    assert files.sufficient_root() == project.parent


def test_a_root_that_does_not_hold_the_scene_is_an_error(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(project / "meshes" / "a.obj"), "--root", str(project / "maps")]) == 1
    assert "is not below the root" in capsys.readouterr().err
    assert main(["import", str(project / "meshes" / "a.obj"), "--root", str(project / "none")]) == 2


def test_materialx_documents_have_a_root(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("MaterialX")
    document = """<materialx version="1.38"><nodegraph name="g"><image name="i" type="color3">
        <input name="file" type="filename" value="../maps/red.png" /></image>
        <output name="o" type="color3" nodename="i" /></nodegraph>
        <UsdPreviewSurface name="s" type="surfaceshader">
        <input name="diffuseColor" type="color3" nodegraph="g" output="o" /></UsdPreviewSurface>
        <surfacematerial name="M" type="material"><input name="surfaceshader" type="surfaceshader" nodename="s" />
        </surfacematerial></materialx>"""
    (project / "meshes" / "m.mtlx").write_text(document)
    arguments = ["material", "import", str(project / "meshes" / "m.mtlx")]
    assert main(arguments) == 0
    captured = capsys.readouterr()
    assert f"--root '{project}'" in captured.err
    assert main([*arguments, "--root", str(project)]) == 0
    captured = capsys.readouterr()
    assert "warning" not in captured.err
    assert "image:" in captured.err
