"""Files and folders that are never half there: the one way in which relume writes a file that others may read, and
deletes a folder that they may.
"""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from relume.core.errors import DiskFullError, RelumeError, is_disk_full

UNFINISHED = ".unfinished-*"
"""Names of files and folders that a killed process left."""


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Write a file that takes its name only when it is complete and on the disk; a failure leaves the old one.

    Args:
        path: what the file will be called; its folder exists.
    Yields:
        The path to write to: hidden, in the same folder, with the same suffix in lower case, by which libraries choose
        a format.
    Raises:
        DiskFullError: there is no room for it. RelumeError: it cannot be written. Other errors than OSError pass.
    """
    unfinished = _temporary_path(path)
    try:
        yield unfinished
        with unfinished.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(unfinished, path)
    except OSError as error:
        if is_disk_full(error):
            raise DiskFullError(path.name) from error
        reason = error.strerror or str(error)
        raise RelumeError(f"{path.name} cannot be written ({reason}); check the folder and its free space") from error
    finally:
        unfinished.unlink(missing_ok=True)


def remove_folder(path: Path) -> None:
    """Delete a folder, which is gone at once: who comes while its files are deleted finds none, not some.

    Args:
        path: of the folder.
    Raises:
        OSError: it is not there, or may not be moved. What can be moved but not deleted is left under another name.
    """
    unfinished = _temporary_path(path)
    path.rename(unfinished)
    shutil.rmtree(unfinished, ignore_errors=True)


def _temporary_path(path: Path) -> Path:
    return path.with_name(UNFINISHED.replace("*", uuid.uuid4().hex + path.suffix.lower()))
