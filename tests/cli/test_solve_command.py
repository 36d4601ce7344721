"""`relume solve`: a picture that the program rendered is matched again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tiny_scenes import still_life

from relume_cli.main import main
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A data folder with a bake of the still life, and the name of the scene."""
    folder = tmp_path_factory.mktemp("solve")
    service = BakeService(folder)
    scene = still_life()
    register_scene(folder, service.ledger, scene)
    service.close()
    arguments = ["--size", "32x24", "--lights", "50", "--method", "direct", "--view", "front"]
    assert main(["bake", scene.name, *arguments, "--data", str(folder)]) == 0
    return folder, scene.name


def solve(baked: tuple[Path, str], output: Path, *arguments: str) -> int:
    folder, name = baked
    return main(["solve", name, "--output", str(output), *arguments, "--data", str(folder)])


def test_the_environment_of_a_picture_comes_back(
    baked: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, name = baked
    (tmp_path / "wanted.json").write_text('{"environment": {"intensity": 3.0}}')
    picture = str(tmp_path / "a.exr")
    words = ["--look", str(tmp_path / "wanted.json"), "--output", picture, "--data", str(folder)]
    assert main(["render", name, *words]) == 0
    capsys.readouterr()
    assert solve(baked, tmp_path / "look.json", "--reference", picture, "--json") == 0
    assert json.loads(capsys.readouterr().out)["residual"] < 0.01
    look = json.loads((tmp_path / "look.json").read_text())
    assert look["environment"]["intensity"] == pytest.approx(3.0, rel=0.01)


def test_strokes_of_a_file_are_matched(baked: tuple[Path, str], tmp_path: Path) -> None:
    strokes = [{"kind": "brighter", "points": [[0, 12], [32, 12]], "radius": 100, "stops": 1.0}]
    (tmp_path / "strokes.json").write_text(json.dumps(strokes))
    assert solve(baked, tmp_path / "look.json", "--strokes", str(tmp_path / "strokes.json")) == 0
    look = json.loads((tmp_path / "look.json").read_text())
    assert look["environment"]["intensity"] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(
    ("strokes", "message"),
    [(None, "--reference is"), ('[{"kind": "louder"}]', "louder"), ("{}", "strokes"), ("no JSON", "--strokes is")],
)
def test_invalid_targets_are_one_sentence(
    baked: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str], strokes: str | None, message: str
) -> None:
    (tmp_path / "strokes.json").write_text(strokes or "")
    arguments = [] if strokes is None else ["--strokes", str(tmp_path / "strokes.json")]
    assert solve(baked, tmp_path / "look.json", *arguments) == 1
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert not (tmp_path / "look.json").exists()
