"""Renders and comparisons of looks that edit glass, by commands alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tiny_scenes import make_camera, make_tiny_scene, quad, studio

from relume.scene.model import Glass, Material
from relume_cli.main import main
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService


@pytest.fixture(scope="module", params=["direct", "probes"])
def baked(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with the scene "tiny", a wall behind a pane that fills the image."""
    folder = tmp_path_factory.mktemp("glass")
    wall = quad("wall", [[-3, -3, -1], [3, -3, -1], [3, 3, -1], [-3, 3, -1]], 0)
    pane = quad("pane", [[-2, -2, 1], [2, -2, 1], [2, 2, 1], [-2, 2, 1]], 1)
    materials = [
        Material("White", ({"model": "lambert", "color": [0.8] * 3},)),
        Material("Pane", (), glass=Glass(ior=1.0, tint=(0.8, 0.8, 0.8))),
    ]
    camera = make_camera("front", (0, 0, 3), (0, 0, 0), 0.6)
    scene = make_tiny_scene(wall, pane, camera=camera, environment=studio(), materials=materials)
    service = BakeService(folder)
    register_scene(folder, service.ledger, scene)
    service.close()
    size = ["--size", "32x24", "--lights", "100", "--method", request.param]
    assert main(["bake", "tiny", *size, "--data", str(folder)]) == 0
    return folder


def rendered(folder: Path, path: Path, look: object) -> np.ndarray:
    look_path = path.with_suffix(".json")
    look_path.write_text(json.dumps(look))
    assert main(["render", "tiny", "--output", str(path), "--look", str(look_path), "--data", str(folder)]) == 0
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def test_a_render_shows_the_color_of_edited_glass(baked: Path, tmp_path: Path) -> None:
    look = {"materials": {"Pane": {"glass": {"color": [0.8, 0.2, 0.8]}}}}
    before, after = rendered(baked, tmp_path / "a.png", {}), rendered(baked, tmp_path / "b.png", look)
    assert (after[..., 1] < before[..., 1] - 20).all()
    assert (after[..., 1] < after[..., 0]).all()


def test_invalid_glass_is_one_sentence(baked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    look_path = tmp_path / "look.json"
    look_path.write_text('{"materials": {"Pane": {"glass": {"ior": 0.5}}}}')
    assert (
        main(["render", "tiny", "--output", str(tmp_path / "a.png"), "--look", str(look_path), "--data", str(baked)])
        != 0
    )
    assert "/materials/Pane/glass/ior is 0.5; give a number in [1, 4]" in capsys.readouterr().err


def test_the_reference_of_edited_glass_agrees_with_the_bake(
    baked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    look_path, output = tmp_path / "look.json", str(tmp_path / "reference.exr")
    look_path.write_text('{"materials": {"Pane": {"glass": {"color": [0.9, 0.3, 0.2]}}}}')
    words = ["--look", str(look_path), "--spp", "512", "--output", output, "--compare", "--json", "--data", str(baked)]
    assert main(["reference", "tiny", *words]) == 0
    document = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert document["error_method_paths"]["rmse"] < 0.06
