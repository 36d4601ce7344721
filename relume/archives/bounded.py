"""Opens a .zip whose list of entries is bounded: `zipfile` reads that list whole, one of millions takes gigabytes.

The records at a file's end say how long the list is, twice where there is a ZIP64 one, and `zipfile` chooses: what it
reads is bounded, not what a record says.
"""

from __future__ import annotations

import zipfile
from typing import BinaryIO, cast


class LongDirectoryError(Exception):
    """The list of entries is longer than it may be."""


class _BoundedFile:
    """A file of which no more is read at once than a list of entries may take, until it is open."""

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
    """The archive in a file that stays open.

    Args:
        file: seekable. max_directory_bytes: that the list of its entries may take.
    Raises:
        LongDirectoryError: it takes more. And whatever `zipfile` raises for damaged data.
    """
    bounded = _BoundedFile(file, max_directory_bytes)
    archive = zipfile.ZipFile(cast(BinaryIO, bounded))
    bounded.is_open = True
    return archive
