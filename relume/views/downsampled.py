"""A bake with fewer pixels: every `step`-th of every `step`-th row, for small pictures of large bakes.

Shading costs a sample's time for each sample, so a thumbnail of all samples takes as long as opening the picture does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.store.bake_protocol import StoreReader


class DownsampledStore:
    """Another store's samples of one view, but for those of the pixels that are left out."""

    def __init__(self, store: StoreReader, view: int, step: int) -> None:
        width, height = store.attributes["size"]
        y, x = np.divmod(store.read(f"views/{view}/pixel"), width)
        self._store, self._prefix = store, f"views/{view}/"
        self._sample_rows = np.flatnonzero((x % step == 0) & (y % step == 0))
        columns, rows = -(-width // step), -(-height // step)
        self._pixel: NDArray[np.uint32] = (y // step * columns + x // step)[self._sample_rows].astype(np.uint32)
        self._attributes = {**store.attributes, "size": [columns, rows]}

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Those of the store, with the smaller size."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array; of one of the view, with the rows that are left."""
        shape = self._store.shape(path)
        return (int(np.searchsorted(self._sample_rows, shape[0])), *shape[1:]) if self._is_downsampled(path) else shape

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Rows [start, stop) of the array at a path, counted among those that are left."""
        if not self._is_downsampled(path):
            return self._store.read(path, start, stop)
        if path == f"{self._prefix}pixel":
            return self._pixel[start:stop]
        rows = self._sample_rows[start : self.shape(path)[0] if stop is None else stop]
        first, end = (int(rows[0]), int(rows[-1]) + 1) if len(rows) else (0, 0)
        return self._store.read(path, first, end)[rows - first]

    def _is_downsampled(self, path: str) -> bool:
        """Whether an array has a row for each sample of the view."""
        return path.startswith(self._prefix) and "/" not in path.removeprefix(self._prefix)
