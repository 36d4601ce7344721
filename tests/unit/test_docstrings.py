"""Public functions with three or more parameters document each of them, or refer to a documentation."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("relume", "worker", "client", "bench", "blender")


def _functions(node: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Public functions of a module, and public methods of its public classes."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ClassDef) and not child.name.startswith("_"):
            yield from _functions(child)
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef) and not child.name.startswith("_"):
            yield child


def _undocumented(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    """Parameters without a mention in the docstring; none for a function with fewer than three, or whose docstring
    refers to another: "See `PROTOCOL`.".
    """
    arguments = function.args
    names = [argument.arg for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    names = [name for name in names if name not in ("self", "cls")]
    said = ast.get_docstring(function) or ""
    if re.search(r"See `\w", said):
        return []
    return [name for name in names if not re.search(rf"\b{name}\b", said)] if len(names) >= 3 else []


def _missing_parameters(package: str) -> list[str]:
    """Missing parameters of docstrings in a folder or file; a line for each function."""
    path = ROOT / package
    files = [path] if path.is_file() else [f for f in sorted(path.rglob("*.py")) if ".venv" not in str(f)]
    return [
        f"{file.relative_to(ROOT)}:{function.lineno} {function.name}: {', '.join(unnamed)}"
        for file in files
        for function in _functions(ast.parse(file.read_text(encoding="utf-8")))
        if (unnamed := _undocumented(function))
    ]


@pytest.mark.parametrize("package", ROOMS)
def test_docstrings_name_every_parameter(package: str) -> None:
    assert _missing_parameters(package) == []


def test_undocumented_parameters_are_detected() -> None:
    (module,) = ast.parse('def f(a, b, *, c):\n    """Of a, and of bc."""').body
    assert isinstance(module, ast.FunctionDef)
    assert _undocumented(module) == ["b", "c"]
