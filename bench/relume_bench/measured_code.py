"""Hash of the code that a figure measures: a stored row with another one is older than the code.

It covers the module of the benchmark and everything that it imports from relume's packages, as
`relume.core.source_hash` finds it: comments count, and so do changes that leave the figure as it is. It does not cover
scripts that other programs run, nor the editor.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from relume.core.source_hash import code_hash, imported_modules

_PACKAGES = ("relume", "relume_bench", "relume_server", "relume_worker", "relume_cli")


@cache
def measured_code(module: str) -> str:
    """Hash of a module and of all modules that it imports, transitively. 16 hexadecimal digits

    Args:
        module: full name of a module of these packages.
    """
    top, _, inside = module.partition(".")
    sources = collect_sources(_package_folders()[top].joinpath(*inside.split(".")).with_suffix(".py"))
    return hashlib.sha256("".join(sorted(map(_source_hash, sources))).encode()).hexdigest()[:16]


@cache
def _package_folders() -> Mapping[str, Path]:
    specs = {name: find_spec(name) for name in _PACKAGES}
    return {name: Path(spec.origin).parent for name, spec in specs.items() if spec is not None and spec.origin}


def collect_sources(path: Path) -> set[Path]:
    """Collect a source and all that it imports from the packages, transitively."""
    sources: set[Path] = set()
    todo = [path]
    while todo:
        path = todo.pop()
        if path not in sources:
            sources.add(path)
            todo.extend(_imports(path))
    return sources


@cache
def _imports(path: Path) -> Sequence[Path]:
    return [module for folder in _package_folders().values() for module in imported_modules(folder, path)]


@cache
def _source_hash(path: Path) -> str:
    folder = next(folder for folder in _package_folders().values() if path.is_relative_to(folder))
    return code_hash([path], folder.parent)


def is_older(figure: Mapping[str, Any], module: str) -> bool:
    """Return whether a stored figure is older than the code that it measures; true if its code was not recorded.

    Args:
        figure: entry of docs/performance.json or docs/accuracy.json. module: of its benchmark.
    """
    code = figure["context"].get("code")
    return code is None or bool(code != measured_code(module))
