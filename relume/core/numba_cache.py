"""Where compiled kernels are kept: one folder for each module and state of its sources, found by Numba's own locators.

Numba's cache notices a change in the file of a kernel, but not in the files of the functions that it calls, so a kernel
could run on with a helper that has since been corrected. A folder's name therefore holds a hash over the module, the
kernels that it imports, directly or through others, and the modules whose constants any of them reads. Where the
checkout lies is not in it: what one has compiled serves all, and of a changed source only what depends on it is
compiled again. The files inside are written by Numba, which tolerates several processes. A process that uses a folder
marks it, and one that makes a new folder removes those that nobody has used for a month.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Self

import platformdirs

from relume.core.source_hash import code_hash, imported_modules

_PACKAGE = Path(__file__).parents[1]
UNUSED_S = 30 * 86_400.0
_FALLBACK_LOCATORS = (
    "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator"  # of kernels that are not the package's
)


def kernel_sources(path: Path, package: Path = _PACKAGE) -> set[Path]:
    """What a module's compiled kernels are made of: itself, and what kernels among that import.

    Plain modules give kernels their constants and are not followed further, but for `__init__`, which hands on names.
    """
    sources, todo = {path}, [path]
    while todo:
        source = todo.pop()
        if source.name == "__init__.py" or _is_kernel(source):
            new = set(imported_modules(package, source)) - sources
            sources |= new
            todo.extend(new)
    return sources


def _is_kernel(path: Path) -> bool:
    source = path.read_bytes()
    return b"import numba" in source or b"from numba" in source


class KernelLocator:
    """Tells Numba where a function of the package is kept; named in NUMBA_CACHE_LOCATOR_CLASSES.

    The methods are those of Numba's own locators. They are not inherited: importing Numba here would cost every
    program half a second.
    """

    def __init__(self, function: FunctionType, path: str) -> None:
        self._py_file, self._function = path, function  # Numba names the file in its warnings

    @classmethod
    def from_function(cls, function: FunctionType, path: str) -> Self | None:
        """A locator of a function of this package; None for others, which Numba's own locators find."""
        return cls(function, path) if _PACKAGE in Path(path).parents else None

    def ensure_cache_path(self) -> None:
        """The folder is made where it is named."""

    def get_cache_path(self) -> str:
        """The folder of the function's module."""
        return str(module_folder(Path(self._py_file)))

    def get_source_stamp(self) -> str:
        """What the files inside must have been made of; the folder's name says it too."""
        return module_folder(Path(self._py_file)).name

    def get_disambiguator(self) -> str:
        """Tells functions of one name apart."""
        return str(self._function.__code__.co_firstlineno)


@cache
def module_folder(path: Path) -> Path:
    """The folder of a module's kernels as its sources are now, made if need be, and marked as used."""
    module = ".".join(path.relative_to(_PACKAGE).with_suffix("").parts)
    folder = cache_folder() / f"{module}-{code_hash(kernel_sources(path))}"
    with suppress(OSError):
        if not folder.exists():
            folder.mkdir(mode=0o700, exist_ok=True)
            remove_unused(folder)  # a good moment, and a rare one
        os.utime(folder)
    return folder


def _is_private(folder: Path) -> bool:
    """Whether we may write here and nobody else may: the cache holds code that is run."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or not os.access(folder, os.W_OK):
        return False
    return os.name == "nt" or (status.st_uid == os.getuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


def _make_private(folder: Path) -> bool:
    """Make `folder` and its parent if they are not there; False where they cannot be ours alone."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        return _is_private(folder.parent) and _is_private(folder)
    except OSError:
        return False


@cache
def cache_folder() -> Path:
    """The folder of all modules' folders, made if need be: in the user's cache, else a temporary one."""
    interpreter = hashlib.sha256(sys.version.encode()).hexdigest()[:16]
    folder = platformdirs.user_cache_path("relume") / "numba" / interpreter
    if _make_private(folder):
        return folder
    import tempfile  # half of this module's import time, and seldom needed

    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / f"relume-numba-{user}" / interpreter
    return folder if _make_private(folder) else Path(tempfile.mkdtemp(prefix="relume-numba-"))


def remove_unused(folder: Path, older_than_s: float = UNUSED_S) -> None:
    """Delete what no process has used for so long beside a module's folder; errors leave it there."""
    for sibling in _module_folders(folder.parent):
        with suppress(OSError):  # another process may be removing it too
            if sibling != folder and _is_private(sibling) and time.time() - sibling.stat().st_mtime > older_than_s:
                shutil.rmtree(sibling)


def _module_folders(folder: Path) -> Iterator[Path]:
    return (path for path in folder.iterdir() if re.fullmatch(r"[\w.]+-[0-9a-f]{16}", path.name))


def use_kernel_cache() -> None:
    """Have Numba ask `KernelLocator`, in this process and in those it starts."""
    locators = f"{__name__}.{KernelLocator.__name__},{_FALLBACK_LOCATORS}"
    os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = locators  # read when Numba is imported
    numba = sys.modules.get("numba")
    if numba is not None:
        numba.config.CACHE_LOCATOR_CLASSES = locators


def disable_kernel_saving() -> None:
    """Have Numba store nothing that this process compiles from now on: other processes would run it."""
    from numba.core.caching import Cache

    setattr(Cache, "save_overload", lambda self, sig, data: None)  # noqa: B010  (a method to mypy)
