"""docs/cli.md: every shown command exists and accepts its options."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from relume_cli.main import main
from relume_cli.pictures.looks import MAX_LOOKS
from relume_worker.presets import PRESETS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "cli.md").read_text(encoding="utf-8")
GROUPS = ("environment", "material", "token", "db")


def commands_on_page() -> list[list[str]]:
    """Words of each command in the page's code blocks."""
    blocks = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    return [shlex.split(command, comments=True)[1:] for line in lines for command in re.findall(r"relume [^\n]*", line)]


@pytest.mark.parametrize("words", commands_on_page(), ids=" ".join)
def test_shown_commands_accept_their_options(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    depth = 2 if words[0] in GROUPS else 1
    assert main([*words[:depth], "--help"]) == 0
    described = capsys.readouterr().out
    for option in (word for word in words[depth:] if word.startswith("--")):
        assert re.search(rf"{option}\b", described)


def test_presets_are_those_of_the_code() -> None:
    rows = dict(re.findall(r"^\| `(\w+)`[^|]*\| (\d+×\d+ \| [\d,]+) \|$", PAGE, re.MULTILINE))
    assert rows == {name: f"{p.size[0]}×{p.size[1]} | {p.num_lights:,}" for name, p in PRESETS.items()}


def test_limit_of_looks_is_that_of_the_code() -> None:
    assert f"{MAX_LOOKS:,} at most" in PAGE
