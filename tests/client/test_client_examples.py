"""The examples run, with a real server and small images."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
WIDTH, HEIGHT = 64, 48
SIZE = "--size", str(WIDTH), str(HEIGHT)
Run = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a server of its own, as `relume serve` starts it."""
    from editor_server import Server

    server = Server(tmp_path_factory.mktemp("examples"))
    server.start()
    yield server.url
    server.kill()


@pytest.fixture
def run(url: str, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run an example with arguments; returns its variables.

    It runs in a thread of its own: where browser tests share this process, theirs has an event loop that runs.
    """
    monkeypatch.setenv("RELUME_URL", url)

    def run_example(name: str, *arguments: object) -> dict[str, Any]:
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        with ThreadPoolExecutor(max_workers=1) as thread:
            return thread.submit(runpy.run_path, str(EXAMPLES / name)).result()

    return run_example


def images(folder: Path) -> list[np.ndarray]:
    return [np.array(Image.open(file)) for file in sorted(folder.glob("*.png"))]


def test_every_example_is_tested() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    names = [file.name for file in sorted(EXAMPLES.glob("*.py"))]
    assert [name for name in names if f'"{name}"' not in text] == []
    assert [name[:2] for name in names] == [f"{number:02}" for number in range(1, len(names) + 1)]


def test_relit_frame_takes_few_lines(run: Run) -> None:
    lines = (EXAMPLES / "01_relit_frame.py").read_text(encoding="utf-8").splitlines()
    assert len([line for line in lines if line.strip()]) <= 8
    made = run("01_relit_frame.py")
    bake, look, image = made["bake"], made["session"].look, made["image"]
    assert (image.shape, image.dtype) == ((240, 320, 3), np.uint8)
    assert look["Bowl"].roughness == 0.3
    (rendered,), (unedited,) = bake.images(look), bake.images({})
    assert np.array_equal(image, rendered)
    assert not np.array_equal(image, unedited)


def test_light_sweep(run: Run, tmp_path: Path) -> None:
    run("02_light_sweep.py", *SIZE, "--steps", 3, "--out", tmp_path)
    swept = images(tmp_path)
    assert [image.shape for image in swept] == [(HEIGHT, WIDTH, 3)] * 3
    assert min(np.abs(swept[0] - image.astype(float)).mean() for image in swept[1:]) > 3


def test_batch_renders(run: Run, tmp_path: Path) -> None:
    made = run("03_batch_renders.py", *SIZE, "--steps", 2, "--out", tmp_path)
    assert [file.name for file in made["files"]] == ["roughness_0000.png", "roughness_0001.png"]
    smooth, rough = images(tmp_path)
    assert smooth.shape == (HEIGHT, WIDTH, 3)
    assert not np.array_equal(smooth, rough)


def test_turntable(run: Run, tmp_path: Path) -> None:
    run("04_turntable.py", "--size", 32, 32, "--probes", 400, "--steps", 2, "--out", tmp_path)
    front, back = images(tmp_path)
    assert front.shape == back.shape == (32, 32, 3)
    assert np.abs(front - back.astype(float)).mean() > 3


def test_compared_looks(run: Run, tmp_path: Path) -> None:
    made = run("05_compare_looks.py", *SIZE, "--out", tmp_path / "both.png")
    assert np.array(Image.open(tmp_path / "both.png")).shape == (HEIGHT, 2 * WIDTH, 3)
    assert made["first"].dtype == np.float32
    squares = [np.sum(each.astype(np.float64) ** 2) for each in (made["second"] - made["first"], made["first"])]
    assert made["difference"] == pytest.approx(np.sqrt(squares[0] / squares[1]), rel=1e-4)
    assert made["difference"] > 0.01
    changed = np.any(made["first"] != made["second"], axis=-1)
    assert 0 < changed.mean() < 1
    assert not np.any(np.any(made["first_shown"] != made["second_shown"], axis=-1) & ~changed)


def test_async_views(run: Run) -> None:
    made = run("06_async_views.py", *SIZE)
    assert made["dim"].shape == (HEIGHT, WIDTH, 3)
    assert made["bright"].mean() > 1.2 * made["dim"].mean()
