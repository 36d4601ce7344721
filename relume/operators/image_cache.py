"""Images of terms, kept beside the rays they were made from: what lies below the memory, and outlives the process.

    <folder>/<code>/<hash of what the image is>.npy

An image that other code made is not found, so that none is ever shown as exact that this code would make otherwise; it
goes when this code keeps its first. All can be lost without loss: what cannot be read, or does not fit, is made again.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Hashable
from contextlib import suppress
from pathlib import Path

import numpy as np

from relume.core.errors import RelumeError
from relume.core.filesystem import atomic_write
from relume.operators.shade import ShadedTerm


class ImageFiles:
    """Files in a folder of a store's own; they go with it.

    Args:
        code: names the code that makes the images, see `relume.core.source_hash`.
        max_bytes: those that were used longest ago go where they would be larger together; None for no bound.
    """

    def __init__(self, folder: Path, code: str, max_bytes: int | None = None) -> None:
        self._folder, self._max_bytes = folder / code, max_bytes

    def get(self, key: Hashable, shape: tuple[int, ...], compute: Callable[[], ShadedTerm]) -> ShadedTerm:
        """The image of a key, from its file where there is a sound one of this shape, else from `compute`."""
        path = self._path(key)
        with suppress(OSError, ValueError, EOFError):
            image = np.load(path, mmap_mode="r", allow_pickle=False)
            if image.shape == shape and image.dtype == np.float32:
                path.touch()
                return ShadedTerm(np.array(image))
        shaded = compute()
        with suppress(OSError, RelumeError):  # a full or read-only disk costs time at the next opening, nothing else
            self._write(path, shaded)
        return shaded

    def has(self, key: Hashable) -> bool:
        """Whether there is a file of a key; nobody says that it is sound."""
        return self._path(key).exists()

    def _path(self, key: Hashable) -> Path:
        return self._folder / (hashlib.sha256(repr(key).encode()).hexdigest()[:32] + ".npy")

    def _write(self, path: Path, shaded: ShadedTerm) -> None:
        if not self._folder.exists():
            self._folder.parent.mkdir(exist_ok=True)
            self._remove_outdated()
            self._folder.mkdir(exist_ok=True)
        with atomic_write(path) as unfinished:
            np.save(unfinished, shaded.image)
        if self._max_bytes is not None:
            self._evict(self._max_bytes)

    def _remove_outdated(self) -> None:
        """Remove what other code has made."""
        for entry in self._folder.parent.iterdir():
            if entry == self._folder:
                continue
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)

    def _evict(self, max_bytes: int) -> None:
        """Remove what was used longest ago until the rest is small enough."""
        files = [(path.stat(), path) for path in self._folder.glob("*.npy")]
        num_bytes = sum(stat.st_size for stat, _ in files)
        for stat, path in sorted(files, key=lambda entry: entry[0].st_mtime_ns):
            if num_bytes <= max_bytes:
                break
            path.unlink(missing_ok=True)
            num_bytes -= stat.st_size
