"""A bake with fewer pixels: the middle one of each `step` × `step` pixels, for small images of large bakes.

Shading takes the same time per sample, so a thumbnail of all samples would take as long as the full image.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.store.bake_protocol import StoreReader


def downsampled_size(size: tuple[int, int], step: int) -> tuple[int, int]:
    """Return the width and height of every `step`-th pixel of an image of a size."""
    width, height = (-(-(side - _first(side, step)) // step) for side in size)
    return width, height


def _first(side: int, step: int) -> int:
    return min(step // 2, side - 1)


class DownsampledStore:
    """Another store's samples of one view, without the omitted pixels."""

    def __init__(self, store: StoreReader, view: int, step: int) -> None:
        width, height = store.attributes["size"]
        y, x = np.divmod(store.read(f"views/{view}/pixel"), width)
        self._store, self._prefix = store, f"views/{view}/"
        left, top = _first(width, step), _first(height, step)
        self._sample_rows = np.flatnonzero((x % step == left) & (y % step == top))
        columns, rows = downsampled_size((width, height), step)
        self._pixel: NDArray[np.uint32] = (y // step * columns + x // step)[self._sample_rows].astype(np.uint32)
        self._attributes = {**store.attributes, "size": [columns, rows]}

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Attributes of the store, with the reduced size."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array; for arrays of the view, with the remaining rows."""
        shape = self._store.shape(path)
        return (int(np.searchsorted(self._sample_rows, shape[0])), *shape[1:]) if self._is_downsampled(path) else shape

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read rows [start, stop) of the array at a path, counted among the remaining rows."""
        if not self._is_downsampled(path):
            return self._store.read(path, start, stop)
        if path == f"{self._prefix}pixel":
            return self._pixel[start:stop]
        rows = self._sample_rows[start : self.shape(path)[0] if stop is None else stop]
        first, end = (int(rows[0]), int(rows[-1]) + 1) if len(rows) else (0, 0)
        return self._store.read(path, first, end)[rows - first]

    def _is_downsampled(self, path: str) -> bool:
        """True if an array has one row per sample of the view."""
        return path.startswith(self._prefix) and "/" not in path.removeprefix(self._prefix)
