"""`relume reference`: the light paths that it traces, and its comparison with a bake's frame."""

import json
import re
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from numpy.typing import NDArray
from tiny_scenes import still_life

from relume_cli.main import main
from relume_cli.reference.passes import percent
from relume_worker.database import open_database
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene

ASKED = ["reference", "still life", "--look"]


@pytest.fixture
def look(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    """A white ball before a white wall, baked by method `direct`; the path of the look."""
    folder = tmp_path / "data"
    folder.mkdir()
    monkeypatch.setenv("RELUME_DATA", str(folder))
    ledger = Ledger(open_database(f"sqlite:///{folder / 'relume.db'}"))
    register_scene(folder, ledger, still_life())
    ledger.close()
    assert (
        main(["bake", "still life", "--view", "front", "--method", "direct", "--size", "32x24", "--lights", "500"]) == 0
    )
    capsys.readouterr()
    file = tmp_path / "look.json"
    white = '{"terms": [{"model": "lambert", "color": [0.9, 0.9, 0.9]}]}'
    file.write_text(f'{{"materials": {{"Ball": {white}, "Wall": {white}, "Floor": {white}}}}}')
    return file


def picture(path: Path) -> NDArray[np.float32]:
    return np.asarray(OpenImageIO.ImageBuf(str(path)).get_pixels(OpenImageIO.FLOAT))


def test_all_paths_are_brighter_than_method_paths_and_omissions_are_printed(
    look: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = [*ASKED, str(look), "--spp", "64", "--size", "32x24", "--output"]
    assert main([*common, str(tmp_path / "all.exr")]) == 0
    assert "not simulated" not in capsys.readouterr().err
    assert main([*common, str(tmp_path / "method.exr"), "--paths", "method"]) == 0
    assert "not simulated by the method: Indirect light" in capsys.readouterr().err
    assert main([*common, str(tmp_path / "direct.exr"), "--method", "direct"]) == 0
    whole, method, direct = (picture(tmp_path / f"{name}.exr") for name in ("all", "method", "direct"))
    assert whole.mean() > 1.05 * method.mean()
    np.testing.assert_array_equal(method, direct)


def test_bake_is_compared_with_method_paths_and_all_paths(
    look: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = str(tmp_path / "truth.exr")
    assert main([*ASKED, str(look), "--spp", "512", "--output", output, "--compare"]) == 0
    against_all, against_method, left_out = capsys.readouterr().out.splitlines()
    match = re.fullmatch(
        r"against all light paths: error ([\d.]+) ± ([\d.]+) % \(relative RMSE\); noise .*", against_all
    )
    assert match is not None
    assert float(match[1]) > 5
    assert 0 < float(match[2]) < 2
    of_method = re.fullmatch(r"against the light paths of its method: .*(?:error|below) ([\d.]+) .*", against_method)
    assert of_method is not None
    assert float(of_method[1]) < 5
    assert left_out.startswith("not simulated by the method: Indirect light")
    assert main([*ASKED, str(look), "--spp", "256", "--output", output, "--compare", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["path"], document["size"]) == (output, [32, 24])
    assert document["error_all_paths"]["error"] == pytest.approx(float(match[1]) / 100, rel=0.2)
    assert document["error_method_paths"]["rmse"] < document["error_all_paths"]["rmse"]
    assert main([*ASKED, str(look), "--spp", "4", "--output", output, "--compare", "--size", "8x6"]) == 1
    assert "the bake has its own" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("share", "error", "said"),
    [
        (0.3271, 0.0004, "32.71 ± 0.04 %"),
        (0.0163, 0.0021, "1.6 ± 0.2 %"),
        (0.31, 0.02, "31 ± 2 %"),
        (0.012, None, "1.2 %"),
        (0.0, None, "0.00 %"),
        (0.5, 1e-12, "50.0000 ± 0.0000 %"),
    ],
)
def test_digits_follow_the_standard_error(share: float, error: float | None, said: str) -> None:
    assert percent(share, error) == said
