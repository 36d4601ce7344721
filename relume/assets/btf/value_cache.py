"""All values of a BTF on disk while it is rendered or read: view by view, so that an interrupted run can resume.

<folder>/values.npy     (views, lights, texels, 3) float16
         done           number of complete views, in decimal digits
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid
from relume.core.errors import CancelledError, MaterialError
from relume.core.filesystem import atomic_write

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]

MAX_VALUE = 60_000.0
"""Near the limit of half precision; brighter values are mirror reflections of the light."""


def value_bytes(grid: DirectionGrid, size: tuple[int, int]) -> int:
    """Size of all values. grid: grid of the directions. size: height and width in texels."""
    return grid.num_directions**2 * size[0] * size[1] * 3 * np.dtype(np.float16).itemsize


class ValueFile:
    """Values that are filled view by view, then read; implements `relume.assets.btf.compressed_view.ViewArrays`.

    Args:
        folder: folder of the files; created if missing. grid: grid of the directions. size: height and width in texels.
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
            raise MaterialError(f"{folder.name} contains another BTF; delete it and start again")
        self._values: F16 = values

    @property
    def num_done(self) -> int:
        """Number of complete views."""
        text = (self._folder / "done").read_text()
        return min(int(text), self._shape[0]) if text.isascii() and text.isdigit() else 0

    def fill(
        self, images: Callable[[int], F32], progress: Callable[[float], object], is_canceled: Callable[[], bool]
    ) -> None:
        """Compute and write the missing views.

        Args:
            images: computes the values of a view, (lights, texels, 3). progress: called with the completed fraction.
            is_canceled: checked before each view.
        Raises:
            CancelledError: `is_canceled` is true; complete views stay.
        """
        for view in range(self.num_done, self._shape[0]):
            if is_canceled():
                raise CancelledError("the rendering was canceled; start it again to resume")
            progress(view / self._shape[0])
            self._values[view] = np.minimum(images(view), MAX_VALUE)
            self._values.flush()  # type: ignore[attr-defined]
            with atomic_write(self._folder / "done") as unfinished:
                unfinished.write_text(str(view + 1))

    def get_view(self, view: int) -> Shaped[F32, "lights texels 3"]:
        """Values of all texels from one view direction."""
        return np.asarray(self._values[view], np.float32)
