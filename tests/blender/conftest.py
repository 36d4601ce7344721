"""Blender in a process of its own, and a real server. `make blender-check` installs bpy and names its Python."""

from __future__ import annotations

import json
import os
import subprocess
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from editor_server import Server

ANSWER = "\x1erelume "


class Blender:
    """Executes Python in Blender."""

    def __init__(self, python: str, url: str, log: Path) -> None:
        worker = Path(__file__).with_name("blender_worker.py")
        self._log = log.open("wb")
        self._process = subprocess.Popen(
            [python, str(worker), url],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
            env={**os.environ, "PYTHONPATH": ""},
        )

    def run(self, source: str) -> Any:
        """Execute source, and return what it assigns to `result`."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(textwrap.dedent(source)) + "\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            if line.startswith(ANSWER):
                answer = json.loads(line.removeprefix(ANSWER))
                assert "error" not in answer, answer["error"]
                return answer["result"]
        raise AssertionError("Blender has ended")

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(timeout=30)
        self._log.close()


@pytest.fixture(scope="module")
def blender_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    if not os.environ.get("RELUME_BLENDER_PYTHON"):
        pytest.skip("RELUME_BLENDER_PYTHON names no Python with bpy (make blender-check installs one)")
    server = Server(tmp_path_factory.mktemp("blender"))
    server.start()
    yield server
    server.kill()


@pytest.fixture(scope="module")
def blender_process(blender_server: Server) -> Iterator[Blender]:
    python = os.environ["RELUME_BLENDER_PYTHON"]
    blender = Blender(python, blender_server.url, blender_server.data / "blender.txt")
    yield blender
    blender.close()


@pytest.fixture
def blender(blender_process: Blender) -> Blender:
    """Blender with an empty file."""
    blender_process.run("clear(); from blender_scene import *")
    return blender_process
