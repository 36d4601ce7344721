"""Hashes over the sources that determine stored results; they are part of the names of images and bakes.

A module and everything that it imports determine a number, so the sources are collected by following imports; a new or
moved module is never missed. Comments count: ignoring them would cost more than recomputing.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_IMPORT = re.compile(r"^\s*(?:from (\w[\w.]*) import (\([^)]*\)|[^\n#]*)|import (\w[\w.]*))", re.MULTILINE)

_IMAGES = ("live.opened", "operators", "live.fixed_camera")
_COMPARISONS = (*_IMAGES, "reference")
_BAKES = ("methods.registry", "scene.scene_folder", "store.run_bake")


@cache
def image_code() -> str:
    """Hash of the code that makes images of terms from a bake. 16 hexadecimal digits"""
    return code_hash(collect_sources(_IMAGES))


@cache
def comparison_code() -> str:
    """Hash of the code that compares images with the reference. 16 hexadecimal digits"""
    return code_hash(collect_sources(_COMPARISONS))


@cache
def bake_code() -> str:
    """Hash of the code that makes bakes from scenes. 16 hexadecimal digits"""
    return code_hash(collect_sources(_BAKES))


def code_hash(sources: Iterable[Path], package: Path = _PACKAGE) -> str:
    """Hash over the names and contents of source files. 16 hexadecimal digits"""
    digest = hashlib.sha256()
    for path in sorted(sources):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def collect_sources(names: Iterable[str], package: Path = _PACKAGE) -> set[Path]:
    """Collect the sources of modules of a package and of all modules of the package that they import, transitively.

    Args:
        names: modules relative to the package, e.g. "store.writer"; for a subpackage, all of its modules.
        package: folder of the package.
    Raises:
        ModuleNotFoundError: a name in `names` does not exist.
    """
    sources: set[Path] = set()
    todo = [source for name in names for source in _roots(package, name)]
    while todo:
        path = todo.pop()
        if path not in sources:
            sources.add(path)
            todo.extend(imported_modules(package, path))
    return sources


def _roots(package: Path, name: str) -> list[Path]:
    folder = package.joinpath(*name.split("."))
    sources = sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]
    if not sources or not all(path.is_file() for path in sources):
        raise ModuleNotFoundError(f"{package.name}.{name} has no sources; stored results cannot be named")
    return sources


def imported_modules(package: Path, path: Path) -> Iterator[Path]:
    """Modules of a package that a source imports: `from a.b import c` may mean module a.b, or a.b.c."""
    for origin, names, module in _IMPORT.findall(path.read_text("utf-8")):
        top, _, inside = (origin or module).partition(".")
        if top != package.name:
            continue
        folder = package.joinpath(*inside.split(".")) if inside else package
        within = (folder / name for name in re.findall(r"\w+", names))
        for candidate in (folder, *within):
            yield from (p for p in (candidate.with_suffix(".py"), candidate / "__init__.py") if p.is_file())
