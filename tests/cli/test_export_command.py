"""`relume export`: the file, warnings with the errors of fits, variants, dry runs and errors."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from relume.scene_io.import_scene import import_scene
from relume_cli.main import main


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with looks, and a data directory with the Cornell box."""
    monkeypatch.setenv("RELUME_DATA", str(tmp_path / "data"))
    terms = [{"model": "lambert", "color": [0.8, 0.1, 0.1]}]
    (tmp_path / "red.json").write_text(json.dumps({"materials": {"Floor": {"terms": terms}}}))
    ward = [{"model": "ward", "color": [0.4, 0.4, 0.4]}]
    (tmp_path / "ward.json").write_text(json.dumps({"materials": {"Floor": {"terms": ward}}}))
    (tmp_path / "other.json").write_text(json.dumps({"materials": {"Teapot": {"terms": terms}}}))
    assert main(["import", "--built-in", "cornell_box"]) == 0
    return tmp_path


def export(folder: Path, *arguments: str) -> int:
    return main(["export", "Cornell box", *arguments])


def test_the_first_look_is_the_files_and_others_are_variants(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    looks = ["--look", str(folder / "red.json"), "--look", str(folder / "ward.json")]
    assert export(folder, str(folder / "a.glb"), *looks) == 0
    assert "warning: Material “Floor” of look “ward” is fitted, error" in capsys.readouterr().err
    scene = import_scene(folder / "a.glb", "again")
    floor = next(material for material in scene.materials if material.name == "Floor")
    assert floor.terms[0]["color"] == pytest.approx([0.8, 0.1, 0.1])
    assert [*scene.variants] == ["ward"]


def test_a_dry_run_reports_and_writes_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    arguments = [str(folder / "a.glb"), "--look", str(folder / "ward.json"), "--dry-run", "--json"]
    assert export(folder, *arguments) == 0
    report = json.loads(capsys.readouterr().out)
    floor = next(material for material in report["materials"] if material["name"] == "Floor")
    assert (floor["exact"], 0.2 < floor["error"] < 0.4) == (False, True)
    assert not (folder / "a.glb").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.blend"], "the export format is '.blend'"),
        (["missing/a.glb"], "a file in a folder that exists"),
        (["a.glb", "--look", "other.json"], "look 'other' is 'Teapot'; give a look of the scene"),
        (["a.glb", "--look", "red.json", "--look", "red.json"], "looks with different names"),
    ],
)
def test_errors_say_what_to_do(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    paths = [word if word.startswith("--") else str(folder / word) for word in arguments]
    assert export(folder, *paths) == 1
    assert message in capsys.readouterr().err
    assert not (folder / "a.glb").exists()
