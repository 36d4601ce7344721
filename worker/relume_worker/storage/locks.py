"""Locks that all processes of the machine see: files that are held open."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path


def open_lock_file(file: Path, mode: int) -> int:
    """An open file that holds a lock; closing it gives it up, as does the end of the process.

    Args:
        file: made where it is missing. mode: as `fcntl.flock` takes it.
    Raises:
        BlockingIOError: somebody else has it, and `mode` is not to wait.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, mode)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor
