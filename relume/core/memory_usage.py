"""What objects and processes hold in memory, and how memory that nobody holds goes back to the system."""

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
    """Bytes of all NumPy arrays that can be reached from objects of relume's own, each counted once.

    Other libraries' objects are not looked into but for SciPy's matrices, nor is the budgeted memory, which tells by
    itself what it holds; files mapped into memory are the system's and count nothing.
    """
    visited: dict[int, object] = {}  # keeps what it has met: an id is one's own only while one lives
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
    """Resident memory of a process; 0 where it has ended, or the system does not tell."""
    try:
        num_pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0
    return num_pages * os.sysconf("SC_PAGE_SIZE")


def trim_heap() -> None:
    """Free what only reference cycles hold, and return free memory to the system; some tenths of a second."""
    gc.collect()
    if _malloc_trim is not None:
        _malloc_trim(0)


def limit_malloc_arenas() -> None:
    """Have all threads of this process allocate from two of glibc's arenas, unless `MALLOC_ARENA_MAX` says how many.

    Of itself each thread gets one of its own, up to eight for each core. What one arena has free no other can use, nor
    the system where something small is left on each of its pages: a process of many threads grows for hours, though
    nothing in it does. To be called before there are many threads.
    """
    if _mallopt is not None and "MALLOC_ARENA_MAX" not in os.environ:
        _mallopt(_M_ARENA_MAX, _NUM_ARENAS)


def _find_in_libc(name: str) -> Any:
    """A function of glibc, which keeps what is freed for the next to ask; others do not, and have none of that name."""
    try:
        return getattr(ctypes.CDLL(None), name)
    except (AttributeError, OSError, TypeError):
        return None


_M_ARENA_MAX, _NUM_ARENAS = -8, 2  # malloc.h
_malloc_trim, _mallopt = _find_in_libc("malloc_trim"), _find_in_libc("mallopt")
