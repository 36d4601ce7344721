"""Files that are never half there."""

from __future__ import annotations

import os
import tempfile
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from relume.errors import RelumeError


class Replacing:
    """A file that takes its name only when it is complete and on the disk."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> BinaryIO:
        handle, self._temporary = tempfile.mkstemp(prefix=".", suffix=".part", dir=self._path.parent)
        self._file = os.fdopen(handle, "wb")
        return self._file

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            if kind is None:
                self._file.flush()
                os.fsync(self._file.fileno())
            self._file.close()
            if kind is None:
                os.replace(self._temporary, self._path)
        finally:
            Path(self._temporary).unlink(missing_ok=True)


def write_whole(path: Path, write: Callable[[Path], None]) -> None:
    """Let a library that wants a path write a file, beside the one that it becomes.

    Args:
        write: called with the path to write to, whose suffix is that of `path`.
    Raises:
        RelumeError: the file cannot be written.
    """
    unfinished = path.with_name(f".unfinished-{uuid.uuid4().hex}{path.suffix.lower()}")
    try:
        write(unfinished)
        os.replace(unfinished, path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise RelumeError(f"{path.name} cannot be written ({reason}); check the folder and its free space") from error
    finally:
        unfinished.unlink(missing_ok=True)
