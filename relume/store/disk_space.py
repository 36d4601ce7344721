"""Disk space checks during jobs: a plan is no bound on disk use, so large writes check the free space first."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
from pathlib import Path
from typing import IO, Any, cast

from relume.core.errors import DiskFullError

RESERVE_BYTES = 64 << 20  # left for the server's own files and for the system
_BUFFER_BYTES = 1 << 20


def check_disk_space(folder: Path, num_bytes: int = 0, label: str = "the store of a bake") -> None:
    """Raise DiskFullError if a job must stop: without the reserve, the database could not even delete entries.

    Args:
        folder: on the disk to check. num_bytes: size of the next write, if known. label: of its files.
    """
    if shutil.disk_usage(folder).free - num_bytes < RESERVE_BYTES:
        raise DiskFullError(label)


class _ScratchFile(io.FileIO):
    """A file that checks the free space before each write."""

    def __init__(self, handle: int, folder: Path) -> None:
        super().__init__(handle, "r+b")
        self._folder = folder

    def write(self, piece: Any, /) -> int:
        check_disk_space(self._folder)
        return super().write(piece) or 0


def scratch_file(folder: Path) -> IO[bytes]:
    """Open a nameless temporary file in a folder; writing raises DiskFullError if space runs out."""
    with tempfile.TemporaryFile(dir=folder) as file:
        raw = _ScratchFile(os.dup(file.fileno()), folder)
    return cast("IO[bytes]", io.BufferedRandom(raw, _BUFFER_BYTES))
