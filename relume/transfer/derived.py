"""Images of terms, kept beside the rays they were made from, so that a bake opens quickly the second time.

They can be lost without loss: whatever cannot be read, or does not fit, is made again.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Hashable
from contextlib import suppress
from pathlib import Path

import numpy as np

from relume.transfer.shade import Shaded


class DerivedImages:
    """Files in a folder of a store's own; they go with it.

    Args:
        max_bytes: those that were used longest ago go where they would be larger together; None for no bound.
    """

    def __init__(self, folder: Path, max_bytes: int | None = None) -> None:
        self._folder, self._max_bytes = folder, max_bytes

    def get(self, key: Hashable, shape: tuple[int, ...], make: Callable[[], Shaded]) -> Shaded:
        """The image of a key, from its file where there is a sound one, else from `make`."""
        path = self._path(key)
        with suppress(OSError, ValueError, EOFError):
            found = np.load(path, mmap_mode="r", allow_pickle=False)
            if found.shape == shape and found.dtype == np.float32:
                path.touch()
                return Shaded(np.array(found))
        shaded = make()
        with suppress(OSError):  # a full or read-only disk costs time at the next opening, nothing else
            self._write(path, shaded)
        return shaded

    def has(self, key: Hashable) -> bool:
        """Whether there is a file of a key; nobody says that it is sound."""
        return self._path(key).exists()

    def _path(self, key: Hashable) -> Path:
        return self._folder / (hashlib.sha256(repr(key).encode()).hexdigest()[:32] + ".npy")

    def _write(self, path: Path, shaded: Shaded) -> None:
        self._folder.mkdir(exist_ok=True)
        partial = path.with_suffix(f".{os.getpid()}.partial")
        try:
            with partial.open("wb") as file:
                np.save(file, shaded.image)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
        if self._max_bytes is not None:
            self._forget(self._max_bytes)

    def _forget(self, max_bytes: int) -> None:
        """Remove what was used longest ago until the rest is small enough."""
        used = [(path.stat(), path) for path in self._folder.glob("*.npy")]
        num_bytes = sum(stat.st_size for stat, _ in used)
        for stat, path in sorted(used, key=lambda entry: entry[0].st_mtime_ns):
            if num_bytes <= max_bytes:
                break
            path.unlink(missing_ok=True)
            num_bytes -= stat.st_size
