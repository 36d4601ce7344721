"""Images of terms, saved beside the rays they were computed from: a disk cache that outlives the process.

    <folder>/<code>/<hash of the image's key>.npy

Images of other versions of the code are not used, so that every exact image is reproducible; they are deleted when this
version saves its first. Files may be lost at any time: what is missing or damaged is computed again.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Hashable
from contextlib import suppress
from pathlib import Path

import numpy as np

from relume.core.digest import digest
from relume.core.errors import RelumeError
from relume.core.filesystem import atomic_write
from relume.operators.shade import ShadedTerm


class ImageFiles:
    """Files in a folder of a store, deleted with it.

    Args:
        code: identifies the code that computes the images, see `relume.core.source_hash`.
        max_bytes: the least recently used files are deleted beyond this total; None for no limit.
    """

    def __init__(self, folder: Path, code: str, max_bytes: int | None = None) -> None:
        self._folder, self._max_bytes = folder / code, max_bytes

    def get(self, key: Hashable, shape: tuple[int, ...], compute: Callable[[], ShadedTerm]) -> ShadedTerm:
        """Return the image of a key, from a valid file of this shape or else from `compute`."""
        path = self._path(key)
        with suppress(OSError, ValueError, EOFError):
            image = np.load(path, mmap_mode="r", allow_pickle=False)
            if image.shape == shape and image.dtype == np.float32:
                path.touch()
                return ShadedTerm(np.array(image))
        shaded = compute()
        with suppress(OSError, RelumeError):  # a full or read-only disk only costs time when the bake is opened again
            self._write(path, shaded)
        return shaded

    def has(self, key: Hashable) -> bool:
        """Return True if a file of a key exists; it may be damaged."""
        return self._path(key).exists()

    def _path(self, key: Hashable) -> Path:
        return self._folder / (digest(key) + ".npy")

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
        """Remove images of other versions of the code."""
        for entry in self._folder.parent.iterdir():
            if entry == self._folder:
                continue
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)

    def _evict(self, max_bytes: int) -> None:
        """Remove the least recently used files beyond a total size."""
        files = [(path.stat(), path) for path in self._folder.glob("*.npy")]
        num_bytes = sum(stat.st_size for stat, _ in files)
        for stat, path in sorted(files, key=lambda entry: entry[0].st_mtime_ns):
            if num_bytes <= max_bytes:
                break
            path.unlink(missing_ok=True)
            num_bytes -= stat.st_size
