"""Lock files, which all processes of the machine see."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path


def open_lock_file(file: Path, mode: int) -> int:
    """Open and lock a file; closing it, or the end of the process, releases the lock.

    Args:
        file: created if missing. mode: as for `fcntl.flock`.
    Raises:
        BlockingIOError: another process has the lock, and `mode` is non-blocking.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, mode)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor
