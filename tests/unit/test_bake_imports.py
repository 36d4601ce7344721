"""Bakes import little, and nothing of pictures: a worker loads no kernel that only a session needs."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

MAX_LINES = 10_200
LOADED = """
import json, sys
from importlib import import_module
from pathlib import Path

import relume

import_module(sys.argv[1])
paths = {name: module.__file__ for name, module in sys.modules.items() if name.split(".")[0] == "relume"}
print(json.dumps({name: len(Path(path).read_text("utf-8").splitlines()) for name, path in paths.items()}))
"""


def loaded_lines(module: str) -> dict[str, int]:
    """Lines of the modules of relume that a new process loads to import one of them."""
    command = [sys.executable, "-c", LOADED, module]
    lines: dict[str, int] = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    return lines


def test_the_shortest_method_imports_few_lines() -> None:
    assert sum(loaded_lines("relume.methods.direct").values()) <= MAX_LINES


@pytest.mark.parametrize("module", ["relume.methods.registry", "relume.methods.disk", "relume_worker.tasks"])
def test_bakes_import_nothing_of_pictures(module: str) -> None:
    shown = ("relume.live", "relume.operators", "relume.output", "relume.reference")
    assert [name for name in loaded_lines(module) if name.startswith(shown)] == []


def test_pictures_import_more_than_bakes() -> None:
    """Modules of pictures have the names that bakes must not load."""
    names = loaded_lines("relume.live.opened.openers").keys()
    assert {"relume.live.opened.fixed_views", "relume.operators.image_cache", "relume.methods.store_layout"} <= names
