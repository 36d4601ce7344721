"""Rooms: folders hold what belongs together, and import each other in one direction.

Children of a folder, its folders and modules alike, are rooms; an import anywhere below one room of anything below
another is an arrow. Arrows may not go round.
"""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("relume", "worker/relume_worker", "server/relume_server", "cli/relume_cli")
Arrows = dict[str, set[str]]


def modules() -> dict[str, Path]:
    """Files by the dotted names of their modules; a package is its folder."""
    return {
        ".".join(path.relative_to((ROOT / package).parent).with_suffix("").parts).removesuffix(".__init__"): path
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def statements(outer: ast.AST) -> Iterator[ast.AST]:
    """All statements inside another, or a file; expressions, which are most of a tree, import nothing."""
    for field in ("body", "handlers", "orelse", "finalbody", "cases"):
        for inner in getattr(outer, field, ()):
            yield inner
            yield from statements(inner)


def imported(path: Path, module_paths: dict[str, Path]) -> Iterator[str]:
    """Modules of ours that a file imports, anywhere in it."""
    for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in module_paths)
        elif isinstance(node, ast.ImportFrom) and node.module in module_paths:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in module_paths else node.module


def rooms_of(importer: str, imported_module: str) -> tuple[str, str] | None:
    """The rooms on both ends of an arrow; None where one module contains the other."""
    ours, theirs = importer.split("."), imported_module.split(".")
    for depth, (ours_name, theirs_name) in enumerate(zip(ours, theirs, strict=False), start=1):
        if ours_name != theirs_name:
            return ".".join(ours[:depth]), ".".join(theirs[:depth])
    return None


def arrows() -> Arrows:
    return {room: set(targets) for room, targets in _all_arrows().items()}


@cache
def _all_arrows() -> Arrows:
    """They cost seconds to find."""
    module_paths, graph = modules(), defaultdict(set)
    for name, path in module_paths.items():
        for target in imported(path, module_paths):
            if (pair := rooms_of(name, target)) is not None:
                graph[pair[0]].add(pair[1])
    return dict(graph)


def circle_in(graph: Arrows) -> list[str] | None:
    """Rooms of one circle, in order; None where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle: list[str] = error.args[1]
        return circle
    return None


def test_rooms_import_each_other_in_one_direction() -> None:
    assert circle_in(arrows()) is None


def test_files_of_tests_have_names_of_their_own() -> None:
    """Test folders are no packages: of two files of one name, pytest would import the first for both."""
    count = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, times in count.items() if times > 1] == []


def test_a_circle_would_be_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": set[str]()}
    assert circle_in(graph) is None
    graph["c"].add("a")
    assert circle_in(graph) is not None
    assert {"relume", "relume_worker"} <= arrows()["relume_server"]
    assert "relume_server.schemas" in arrows()["relume_server.api"]
