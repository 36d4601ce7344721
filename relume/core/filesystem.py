"""Atomic writes and deletes: no reader finds a half-written file or a half-deleted folder."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from relume.core.errors import DiskFullError, RelumeError, is_disk_full

_FULL_BYTES = 1 << 20  # a disk with less is full
UNFINISHED = ".unfinished-*"
"""Glob pattern of files and folders that a killed process left behind."""


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Write a file that takes its name only when it is complete and on disk; a failure leaves the old file.

    Args:
        path: final path; its folder exists.
    Yields:
        The path to write to: hidden, in the same folder, with the same suffix in lower case, by which libraries choose
        a format.
    Raises:
        DiskFullError: the disk is full. RelumeError: any other OSError. Other exceptions propagate.
    """
    unfinished = _temporary_path(path)
    try:
        yield unfinished
        with unfinished.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(unfinished, path)
    except OSError as error:
        if is_disk_full(error) or (error.errno is None and _has_no_space(path.parent)):
            raise DiskFullError(path.name) from error
        # image libraries raise errors without a number, and with the path of the machine
        reason = error.strerror or (str(error) if error.errno is not None else type(error).__name__)
        raise RelumeError(f"{path.name} cannot be written ({reason}); check the folder and its free space") from error
    finally:
        unfinished.unlink(missing_ok=True)


def _has_no_space(folder: Path) -> bool:
    """Return whether the disk of a folder is full; False if there is no such folder."""
    try:
        return shutil.disk_usage(folder).free < _FULL_BYTES
    except OSError:
        return False


def remove_folder(path: Path) -> None:
    """Delete a folder atomically: it is renamed first, so readers find either all of its files or no folder.

    Raises:
        OSError: the folder does not exist or cannot be renamed. Files that cannot be deleted remain under another name.
    """
    unfinished = _temporary_path(path)
    path.rename(unfinished)
    shutil.rmtree(unfinished, ignore_errors=True)


def _temporary_path(path: Path) -> Path:
    return path.with_name(UNFINISHED.replace("*", uuid.uuid4().hex + path.suffix.lower()))
