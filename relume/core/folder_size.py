"""Folders on the disk."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def folder_bytes(folder: Path) -> int:
    """What the files in a folder take, those of its folders too; nothing where there is none.

    What somebody deletes while it is counted takes nothing either.
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
