"""Packages and modules of a folder import each other in one direction.

Each folder's direct children, packages and modules alike, are nodes of a graph; an import from anywhere below one
node to anywhere below another is an edge. The graph of every folder must be acyclic.
"""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("relume", "worker/relume_worker", "server/relume_server", "cli/relume_cli", "client/relume_client")
Graph = dict[str, set[str]]


def modules() -> dict[str, Path]:
    """Files by the dotted names of their modules; a package is its folder."""
    return {
        ".".join(path.relative_to((ROOT / package).parent).with_suffix("").parts).removesuffix(".__init__"): path
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def nested_statements(outer: ast.AST) -> Iterator[ast.AST]:
    """All nested statements of a statement or a file; expressions, which are most of a tree, import nothing."""
    for field in ("body", "handlers", "orelse", "finalbody", "cases"):
        for inner in getattr(outer, field, ()):
            yield inner
            yield from nested_statements(inner)


def imported_modules(path: Path, module_paths: dict[str, Path]) -> Iterator[str]:
    """Modules of the repository that a file imports, anywhere in it."""
    for node in nested_statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in module_paths)
        elif isinstance(node, ast.ImportFrom) and node.module in module_paths:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in module_paths else node.module


def siblings_of(importer: str, imported_module: str) -> tuple[str, str] | None:
    """Sibling nodes of an import; None if one module contains the other."""
    ours, theirs = importer.split("."), imported_module.split(".")
    for depth, (importer_part, imported_part) in enumerate(zip(ours, theirs, strict=False), start=1):
        if importer_part != imported_part:
            return ".".join(ours[:depth]), ".".join(theirs[:depth])
    return None


def edges() -> Graph:
    return {room: set(targets) for room, targets in _all_edges().items()}


@cache
def _all_edges() -> Graph:
    """Cached: finding them takes seconds."""
    module_paths, graph = modules(), defaultdict(set)
    for name, path in module_paths.items():
        for target in imported_modules(path, module_paths):
            if (pair := siblings_of(name, target)) is not None:
                graph[pair[0]].add(pair[1])
    return dict(graph)


def find_cycle(graph: Graph) -> list[str] | None:
    """Nodes of one cycle, in order; None if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle: list[str] = error.args[1]
        return circle
    return None


def test_imports_have_one_direction() -> None:
    assert find_cycle(edges()) is None


def test_test_modules_have_unique_names() -> None:
    """Test folders are no packages: of two files of one name, pytest would import the first for both."""
    count = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, times in count.items() if times > 1] == []


def test_a_cycle_is_detected() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": set[str]()}
    assert find_cycle(graph) is None
    graph["c"].add("a")
    assert find_cycle(graph) is not None
    assert {"relume", "relume_worker"} <= edges()["relume_server"]
    assert "relume_server.schemas" in edges()["relume_server.api"]
