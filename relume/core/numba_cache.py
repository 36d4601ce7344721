"""Cache folders for compiled kernels, one per module and state of its sources, found by Numba's cache locators.

Numba's cache notices a change in the file of a kernel, but not in the files of the functions that it calls, so a kernel
could run with an outdated helper. A folder's name therefore holds a hash over the module, the kernels that it imports,
directly or indirectly, and the modules whose constants any of these kernels read. The hash ignores the location of the
checkout: checkouts share compiled kernels, and after a change only dependent kernels are compiled again. Numba writes
the files inside and tolerates several processes. A process that uses a folder updates its time stamp, and a process
that makes a new folder removes folders unused for a month.
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
    "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator"  # for kernels outside the package
)


def kernel_sources(path: Path, package: Path = _PACKAGE) -> set[Path]:
    """Sources of a module's compiled kernels: the module itself and the modules that its kernels import.

    Plain modules give kernels their constants and are not followed further, except `__init__`, which re-exports names.
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
    """Numba cache locator for functions of the package; named in NUMBA_CACHE_LOCATOR_CLASSES.

    The methods are those of Numba's own locators. They are not inherited: importing Numba here would cost every
    program half a second.
    """

    def __init__(self, function: FunctionType, path: str) -> None:
        self._py_file, self._function = path, function  # Numba's warnings name the file

    @classmethod
    def from_function(cls, function: FunctionType, path: str) -> Self | None:
        """Make a locator for a function of this package; None for others, which Numba's own locators handle."""
        return cls(function, path) if _PACKAGE in Path(path).parents else None

    def ensure_cache_path(self) -> None:
        """Do nothing: `module_folder` makes the folder."""

    def get_cache_path(self) -> str:
        """The folder of the function's module."""
        return str(module_folder(Path(self._py_file)))

    def get_source_stamp(self) -> str:
        """Stamp of the sources; the folder's name already identifies them."""
        return module_folder(Path(self._py_file)).name

    def get_disambiguator(self) -> str:
        """Distinguish functions of the same name."""
        return str(self._function.__code__.co_firstlineno)


@cache
def module_folder(path: Path) -> Path:
    """Folder for a module's kernels at the current state of its sources, made if needed, and marked as used."""
    module = ".".join(path.relative_to(_PACKAGE).with_suffix("").parts)
    folder = cache_folder() / f"{module}-{code_hash(kernel_sources(path))}"
    with suppress(OSError):
        if not folder.exists():
            folder.mkdir(mode=0o700, exist_ok=True)
            remove_unused(folder)  # a rare event, so cleanup costs little
        os.utime(folder)
    return folder


def _is_private(folder: Path) -> bool:
    """True if only this user may write to the folder: the cache holds executable code."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or not os.access(folder, os.W_OK):
        return False
    return os.name == "nt" or (status.st_uid == os.getuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


def _make_private(folder: Path) -> bool:
    """Make `folder` and its parent if needed; False if they cannot be private to this user."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        return _is_private(folder.parent) and _is_private(folder)
    except OSError:
        return False


@cache
def cache_folder() -> Path:
    """Folder that contains the folders of all modules, made if needed: in the user's cache, else temporary."""
    interpreter = hashlib.sha256(sys.version.encode()).hexdigest()[:16]
    folder = platformdirs.user_cache_path("relume") / "numba" / interpreter
    if _make_private(folder):
        return folder
    import tempfile  # half of this module's import time, and rarely needed

    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / f"relume-numba-{user}" / interpreter
    return folder if _make_private(folder) else Path(tempfile.mkdtemp(prefix="relume-numba-"))


def remove_unused(folder: Path, older_than_s: float = UNUSED_S) -> None:
    """Delete siblings of a module's folder that no process has used for `older_than_s`; errors leave them there."""
    for sibling in _module_folders(folder.parent):
        with suppress(OSError):  # another process may be removing the same folder
            if sibling != folder and _is_private(sibling) and time.time() - sibling.stat().st_mtime > older_than_s:
                shutil.rmtree(sibling)


def _module_folders(folder: Path) -> Iterator[Path]:
    return (path for path in folder.iterdir() if re.fullmatch(r"[\w.]+-[0-9a-f]{16}", path.name))


def use_kernel_cache() -> None:
    """Make Numba use `KernelLocator`, in this process and in its child processes."""
    locators = f"{__name__}.{KernelLocator.__name__},{_FALLBACK_LOCATORS}"
    os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = locators  # read when Numba is imported
    numba = sys.modules.get("numba")
    if numba is not None:
        numba.config.CACHE_LOCATOR_CLASSES = locators


def disable_kernel_saving() -> None:
    """Stop Numba from storing kernels that this process compiles from now on; other processes would run them."""
    from numba.core.caching import Cache

    setattr(Cache, "save_overload", lambda self, sig, data: None)  # noqa: B010  (a method to mypy)
