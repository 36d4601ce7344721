"""Kernels without reference counting must not return arrays: docs/adr/0009-numba-and-embree.md."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

RELUME = Path(__file__).resolve().parents[2] / "relume"


def kernels(source: str) -> Iterator[ast.FunctionDef]:
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef) and any("**NO_REFCOUNT" in ast.unparse(d) for d in node.decorator_list):
            yield node


def returns_arrays(kernel: ast.FunctionDef) -> bool:
    """True if the returned value is indexed elsewhere, or a slice."""
    indexed = {
        node.value.id
        for node in ast.walk(kernel)
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name)
    }
    for node in ast.walk(kernel):
        if not isinstance(node, ast.Return) or node.value is None:
            continue
        for value in node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]:
            if isinstance(value, ast.Name) and value.id in indexed:
                return True
            if isinstance(value, ast.Subscript) and any(isinstance(inner, ast.Slice) for inner in ast.walk(value)):
                return True
    return False


def test_kernels_without_references_return_no_arrays() -> None:
    kernels_found = [(path, kernel) for path in RELUME.rglob("*.py") for kernel in kernels(path.read_text())]
    assert len(kernels_found) > 100
    assert [f"{path.name}: {kernel.name}" for path, kernel in kernels_found if returns_arrays(kernel)] == []


def test_a_returned_array_is_detected() -> None:
    source = "@nb.njit(**NO_REFCOUNT)\ndef f(a, k):\n    b = a[k]\n    b[0] = 1\n    return {}\n"
    returned = {"b": True, "a": True, "b[1:]": True, "b[0]": False, "(k, b)": True, "k": False, "(k, b[0])": False}
    for text, is_array in returned.items():
        assert [returns_arrays(kernel) for kernel in kernels(source.format(text))] == [is_array], text
