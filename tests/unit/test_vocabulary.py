"""Names and sentences use the field's words: see docs/glossary.md and `vocabulary`."""

from __future__ import annotations

import ast
import functools
from collections import Counter
from pathlib import Path

import pytest
from vocabulary import Finding, read, read_python, words_of

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {
    "relume": "relume",
    "worker": "worker/relume_worker",
    "server": "server/relume_server",
    "cli": "cli/relume_cli",
    "client": "client/relume_client",
    "bench": "bench/relume_bench",
    "blender": "blender/relume_blender",
}
SPOKEN = (
    *PACKAGES.values(),
    "tests",
    "examples",
    "client_web/src",
    "client_web/index.html",
    "docs",
    "README.md",
    "CHANGELOG.md",
)
MAX_VAGUE_NAMES = 100

EXCEPTIONS: dict[str, str] = {
    "tests/vocabulary.py": "lists the retired words",
    "tests/unit/test_vocabulary.py": "has examples of them",
    "tests/worker/test_schema_revisions.py": "writes the former spelling of a state, which an upgrade replaces",
    "client_web/src/viewport/cameras/cameras.css": "::backdrop is a pseudo-element of CSS",
    "relume/scene/examples/cornell.py": "a light of this scene is named Lamp",
}
"""Starts of places, or of places and texts, that say otherwise, and why."""


def _is_excepted(finding: Finding) -> bool:
    line = f"{finding.location}  {finding.text}"
    return any(line.startswith(start) for start in EXCEPTIONS)


@functools.cache
def _findings(folder: str) -> tuple[Finding, ...]:
    """Read a folder once for both tests of its words."""
    named = (
        finding._replace(location=str(Path(finding.location).relative_to(ROOT))) for finding in read([ROOT / folder])
    )
    return tuple(finding for finding in named if not _is_excepted(finding))


@pytest.mark.parametrize("path", SPOKEN)
def test_retired_words_are_gone(path: str) -> None:
    assert [finding for finding in _findings(path) if finding.kind != "vague"] == []


def test_few_names_want_their_neighbors() -> None:
    vague = [
        finding for place in (*PACKAGES.values(), "tests") for finding in _findings(place) if finding.kind == "vague"
    ]
    assert len(vague) <= MAX_VAGUE_NAMES, Counter(finding.text for finding in vague)


@pytest.mark.parametrize("folder", PACKAGES.values())
def test_a_class_name_is_used_once_in_a_package(folder: str) -> None:
    classes = Counter(
        node.name
        for path in (ROOT / folder).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in classes.items() if count > 1] == []


@pytest.mark.parametrize("folder", PACKAGES.values())
def test_a_module_name_is_used_at_most_twice_in_a_package(folder: str) -> None:
    modules = Counter(path.stem for path in (ROOT / folder).rglob("*.py"))
    assert [name for name, count in modules.items() if count > 2 and name != "__init__"] == []


def test_retired_words_are_found(tmp_path: Path) -> None:
    module = tmp_path / "eye_paths.py"
    module.write_text(
        '"""What an eye sees."""\n\nfound = "the colour of lamps"\n\ndef sunDisk(sky_map):\n    pass  # grey\n'
    )
    assert Counter(finding.kind for finding in read([module])) == {
        "identifier": 2, "vague": 1, "prose": 2, "spelling": 2, "docstring": 1,
    }  # fmt: skip
    assert [finding.text for finding in read_python(module) if finding.kind == "vague"] == ["found"]


def test_words_of_names() -> None:
    assert words_of("SunDisk") == words_of("sunDisk") == words_of("sun_disk") == ["sun", "disk"]
