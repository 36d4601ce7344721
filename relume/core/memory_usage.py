"""Memory held by objects and processes, and its return to the system."""

from __future__ import annotations

import ctypes
import gc
import mmap
import os
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

_OPEN_MODULES = ("builtins", "collections", "functools")
_OPEN_PACKAGES = ("relume", "scipy")
_SELF_COUNTING_MODULE = "relume.core.cache"


def live_bytes(*roots: object) -> int:
    """Bytes of all NumPy arrays reachable from relume's own objects, each array counted once.

    Objects of other libraries are not searched, except SciPy matrices; nor is the cache, which counts its own entries.
    Memory-mapped files belong to the system and count nothing.
    """
    visited: dict[int, object] = {}  # keeps objects alive: an id is unique only while its object lives
    todo, total = list(roots), 0
    while todo:
        item = todo.pop()
        if id(item) in visited or isinstance(item, type):
            continue
        visited[id(item)] = item
        if isinstance(item, np.ndarray):
            if isinstance(item.base, np.ndarray):
                todo.append(item.base)
            else:
                total += _own_bytes(item)
        elif isinstance(item, FunctionType):
            todo.extend(item.__closure__ or ())
        elif _is_open(type(item).__module__):
            todo.extend(gc.get_referents(item))
    return total


def _is_open(module: str) -> bool:
    return module in _OPEN_MODULES or (module.partition(".")[0] in _OPEN_PACKAGES and module != _SELF_COUNTING_MODULE)


def _own_bytes(array: NDArray[Any]) -> int:
    return 0 if isinstance(array.base, mmap.mmap) else array.nbytes


def resident_bytes(pid: int) -> int:
    """Resident memory of a process, in bytes; 0 if it has ended or the system does not report it."""
    try:
        num_pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0
    return num_pages * os.sysconf("SC_PAGE_SIZE")


def trim_heap() -> None:
    """Collect reference cycles and return free heap memory to the system; takes some tenths of a second."""
    gc.collect()
    if _malloc_trim is not None:
        _malloc_trim(0)


def limit_malloc_arenas() -> None:
    """Limit all threads of this process to two glibc malloc arenas, unless `MALLOC_ARENA_MAX` sets a number.

    By default each thread gets its own arena, up to eight per core. No other arena can use the free memory of one, and
    a page with one small allocation cannot go back to the system: a process with many threads grows for hours without
    a leak. Call this before there are many threads.
    """
    if _mallopt is not None and "MALLOC_ARENA_MAX" not in os.environ:
        _mallopt(_M_ARENA_MAX, _NUM_ARENAS)


def _find_in_libc(name: str) -> Any:
    """Look up a glibc function; None for other C libraries, which do not keep freed memory in arenas."""
    try:
        return getattr(ctypes.CDLL(None), name)
    except (AttributeError, OSError, TypeError):
        return None


_M_ARENA_MAX, _NUM_ARENAS = -8, 2  # malloc.h
_malloc_trim, _mallopt = _find_in_libc("malloc_trim"), _find_in_libc("mallopt")
