"""Files that are never half there."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import BinaryIO


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
