"""All values of a BTF on the disk while it is made or read: one side after another, so that a killed run goes on.

<folder>/values.npy     (views, lights, texels, 3) float16
         done           how many views are written, in decimal digits
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid
from relume.core.errors import CancelledError, MaterialError
from relume.core.filesystem import atomic_write

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]

MAX_VALUE = 60_000.0
"""That half precision holds; what is brighter is a mirror of the lamp."""


class ValueFile:
    """Values as they are filled in, then read; implements `relume.assets.btf.compress.ViewArrays`.

    Args:
        folder: where they are, or will be. grid: of the directions. size: height and width in texels.
    """

    def __init__(self, folder: Path, grid: DirectionGrid, size: tuple[int, int]) -> None:
        self.grid, self.size, self._folder = grid, size, folder
        folder.mkdir(parents=True, exist_ok=True)
        self._shape = (grid.num_directions, grid.num_directions, size[0] * size[1], 3)
        path = folder / "values.npy"
        if not path.exists():
            with atomic_write(path) as unfinished:
                np.lib.format.open_memmap(unfinished, "w+", np.float16, self._shape).flush()
            (folder / "done").write_text("0")
        values = np.load(path, mmap_mode="r+", allow_pickle=False)
        if values.shape != self._shape or values.dtype != np.float16:
            raise MaterialError(f"{folder.name} holds another BTF; delete it and start again")
        self._values: F16 = values

    @property
    def num_done(self) -> int:
        """Views that are there."""
        text = (self._folder / "done").read_text()
        return min(int(text), self._shape[0]) if text.isascii() and text.isdigit() else 0

    def fill(
        self, images: Callable[[int], F32], progress: Callable[[float], object], is_canceled: Callable[[], bool]
    ) -> None:
        """Write the views that are not there yet.

        Args:
            images: values seen from a view, (lights, texels, 3). progress: called with the share done.
            is_canceled: asked before each view.
        Raises:
            CancelledError: `is_canceled` said so; what is there stays.
        """
        for view in range(self.num_done, self._shape[0]):
            if is_canceled():
                raise CancelledError("it was cancelled; the same again goes on from there")
            progress(view / self._shape[0])
            self._values[view] = np.minimum(images(view), MAX_VALUE)
            self._values.flush()  # type: ignore[attr-defined]
            with atomic_write(self._folder / "done") as unfinished:
                unfinished.write_text(str(view + 1))

    def get_view(self, view: int) -> F32:
        """Every texel's values from one direction. (lights, texels, 3) float32"""
        return np.asarray(self._values[view], np.float32)
