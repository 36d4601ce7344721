"""The rest of the disk that bakes leave: a plan is no bound, so whoever writes something large looks for room first."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
from pathlib import Path
from typing import IO, Any, cast

from relume.core.errors import DiskFullError

RESERVE_BYTES = 64 << 20  # left for the server's own work and for the system
_BUFFER_BYTES = 1 << 20


def check_disk_space(folder: Path) -> None:
    """Raise DiskFullError where a bake is to stop: without the rest of the disk the ledger could not even delete."""
    if shutil.disk_usage(folder).free < RESERVE_BYTES:
        raise DiskFullError("the store of a bake")


class _ScratchFile(io.FileIO):
    """A file that looks for room before each piece that it writes."""

    def __init__(self, handle: int, folder: Path) -> None:
        super().__init__(handle, "r+b")
        self._folder = folder

    def write(self, piece: Any, /) -> int:
        check_disk_space(self._folder)
        return super().write(piece) or 0


def scratch_file(folder: Path) -> IO[bytes]:
    """Open a file in a folder that has no name and is gone when it is closed; writing raises DiskFullError."""
    with tempfile.TemporaryFile(dir=folder) as file:
        raw = _ScratchFile(os.dup(file.fileno()), folder)
    return cast("IO[bytes]", io.BufferedRandom(raw, _BUFFER_BYTES))
