"""Disk usage of folders."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def folder_bytes(folder: Path) -> int:
    """Total size of the files in a folder and its subfolders, in bytes; 0 if it does not exist.

    Files that are deleted during the count are skipped.
    """
    total = 0
    for parent, _, names in os.walk(folder, onerror=_raise_unless_missing):
        for name in names:
            with suppress(FileNotFoundError):
                total += os.stat(os.path.join(parent, name)).st_size
    return total


def _raise_unless_missing(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error
