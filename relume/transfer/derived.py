"""Images of a scene's own look, kept beside the rays they were made from, so that a bake opens quickly the second time.

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

_FOLDER = "derived"


class DerivedImages:
    """Files in a store's own folder; they go with it."""

    def __init__(self, store: Path) -> None:
        self._folder = store / _FOLDER

    def get(self, key: Hashable, shape: tuple[int, ...], make: Callable[[], Shaded]) -> Shaded:
        """The image of a key, from its file where there is a sound one, else from `make`."""
        path = self._folder / (hashlib.sha256(repr(key).encode()).hexdigest()[:32] + ".npy")
        with suppress(OSError, ValueError, EOFError):
            found = np.load(path, mmap_mode="r", allow_pickle=False)
            if found.shape == shape and found.dtype == np.float32:
                return Shaded(np.array(found))
        shaded = make()
        with suppress(OSError):  # a full or read-only disk costs time at the next opening, nothing else
            self._write(path, shaded)
        return shaded

    def _write(self, path: Path, shaded: Shaded) -> None:
        self._folder.mkdir(exist_ok=True)
        partial = path.with_suffix(f".{os.getpid()}.partial")
        try:
            with partial.open("wb") as file:
                np.save(file, shaded.image)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
