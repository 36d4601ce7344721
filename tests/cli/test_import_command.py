"""`relume import`: import options, and the JSON of an imported scene."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest
from glb_builder import Glb

from relume_cli.main import main

QUAD = "mtllib m.mtl\nv 0 0 0\nv 200 0 0\nv 200 0 100\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl Red\nf 1/1 2/2 3/3\nl 1 2\n"


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An OBJ file with an image, in a folder of its own; and an empty data directory."""
    monkeypatch.setenv("RELUME_DATA", str(tmp_path / "data"))
    encoded = io.BytesIO()
    PIL.Image.new("RGB", (4, 2), (255, 0, 0)).save(encoded, "PNG")
    (tmp_path / "t.png").write_bytes(encoded.getvalue())
    (tmp_path / "m.mtl").write_text("newmtl Red\nKd 1 1 1\nKe 2\nmap_Kd t.png\n")
    (tmp_path / "quad.obj").write_text(QUAD)
    return tmp_path / "quad.obj"


def imported(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["import", *arguments, "--json"]) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return document


def test_the_json_of_an_import_has_its_content(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = imported(capsys, str(file), "--up", "z", "--unit", "cm")
    assert scene["name"] == "quad"
    assert scene["triangles"] == 1
    assert scene["bounds"] == [[0, 0, 0], [2, 1, 0]]
    assert scene["area"] == pytest.approx(1)
    (material,) = scene["materials"]
    assert material["name"] == "Red"
    assert material["terms"][0]["texture"] == "diffuse"
    assert material["textures"] == {"diffuse": {"size": [4, 2], "wrap": ["repeat", "repeat"]}}
    assert scene["lights"][0]["name"] == "Red"
    assert scene["lights"][0]["emission"] == [2, 2, 2]
    assert [camera["name"] for camera in scene["cameras"]] == ["front"]
    (warning,) = scene["warnings"]
    assert warning["severity"] == "ignored"
    assert warning.keys() == {"severity", "text", "where"}


def test_the_next_import_remembers_the_options(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = imported(capsys, str(file), "--up", "z", "--unit", "cm")
    file.write_text(QUAD.replace("v 200 0 100", "v 200 0 50"))
    second = imported(capsys, str(file), "--unit", "mm")
    assert first["import_options"] == {"up": "z", "unit": "cm"}
    assert second["import_options"] == {"up": "z", "unit": "mm"}
    assert second["bounds"][1] == pytest.approx([0.2, 0.05, 0])
    third = imported(capsys, str(file), "--up", "file", "--unit", "file")
    assert third["bounds"][1] == [200, 0, 50]


def test_the_time_of_an_animation_is_remembered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RELUME_DATA", str(tmp_path / "data"))
    glb = Glb().quad()
    sampler = {
        "input": glb.accessor(np.array([0, 2], np.float32)),
        "output": glb.accessor(np.array([[0, 0, 0], [0, 0, 4]], np.float32)),
    }
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    glb.document["animations"] = [{"channels": [channel], "samplers": [sampler]}]
    (tmp_path / "moving.glb").write_bytes(glb.bytes())
    first = imported(capsys, str(tmp_path / "moving.glb"), "--time", "0.5")
    assert first["bounds"][0] == [0, 0, 1]
    assert first["import_options"] == {"time": "0.5"}
    assert imported(capsys, str(tmp_path / "moving.glb"))["bounds"][0] == [0, 0, 1]
    assert imported(capsys, str(tmp_path / "moving.glb"), "--time", "2")["bounds"][0] == [0, 0, 4]
