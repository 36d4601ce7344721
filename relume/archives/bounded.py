"""Opening of .zip files with a limit on the directory, since `zipfile` reads gigabytes for millions of entries.

The records at a file's end state the directory's size, twice with ZIP64, and `zipfile` chooses between them. The limit
is therefore on the bytes that it reads, not on the stated size.
"""

from __future__ import annotations

import zipfile
from typing import BinaryIO, cast


class LongDirectoryError(Exception):
    """The directory exceeds its limit."""


class _BoundedFile:
    """A file that limits the size of each read until the archive is open."""

    def __init__(self, file: BinaryIO, max_directory_bytes: int) -> None:
        self._file, self._max_directory_bytes = file, max_directory_bytes
        self.is_open = False
        self.seek, self.tell, self.seekable, self.close = file.seek, file.tell, file.seekable, file.close

    def read(self, size: int | None = -1, /) -> bytes:
        """See `io.RawIOBase`. Raises LongDirectoryError."""
        if not self.is_open and size is not None and size > self._max_directory_bytes:
            raise LongDirectoryError
        return self._file.read(-1 if size is None else size)


def open_bounded(file: BinaryIO, max_directory_bytes: int) -> zipfile.ZipFile:
    """Open the archive in a file, which stays open.

    Args:
        file: seekable. max_directory_bytes: limit on the directory.
    Raises:
        LongDirectoryError: the directory exceeds the limit. Errors of `zipfile` for damaged data propagate.
    """
    bounded = _BoundedFile(file, max_directory_bytes)
    archive = zipfile.ZipFile(cast(BinaryIO, bounded))
    bounded.is_open = True
    return archive
