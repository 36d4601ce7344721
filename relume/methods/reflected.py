"""What the gather cells of a bake send out under the lights of its pictures, computed once for all of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relume.memory import Memory
from relume.methods.cell_light import CellLight
from relume.picture.light import Light
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]


class Reflected:
    """Radiance of cells under a light, (NO_CELL + 1, 3) float32; safe to use from several threads.

    Args:
        irradiance: that comes to the cells from the lights themselves, exactly or for a preview. (C, 3) float32
        key: of the bake in `memory`.
    """

    def __init__(self, cells: CellLight, irradiance: Callable[[Light, bool], F32], memory: Memory, key: str) -> None:
        self.num_cells = cells.num_cells
        self._cells, self._irradiance = cells, irradiance
        self._memory, self._key = memory, key

    def under(self, light: Light) -> F32:
        """What exact pictures show."""
        return self._kept(light, is_preview=False)

    def preview_under(self, light: Light) -> F32:
        """What pictures follow while a hand moves; waits for nobody who wants something exact."""
        return self._kept(light, is_preview=True)

    def _kept(self, light: Light, *, is_preview: bool) -> F32:
        between, memory = _between_surfaces(light), self._memory.passing if is_preview else self._memory
        key = self._key, "reflected light", between, is_preview
        return memory.keep(key, lambda: self._radiance(between, is_preview=is_preview))

    def _radiance(self, light: Light, *, is_preview: bool) -> F32:
        paths, chosen = light.paths, light.reflectances
        if not paths.reflect:
            return np.zeros((NO_CELL + 1, 3), np.float32)
        key = self._key, "reflectance", chosen
        memory = self._memory.passing if is_preview else self._memory
        reflectance = memory.keep(key, lambda: self._cells.reflectance(chosen))
        arriving = self._irradiance(light, is_preview)
        return self._cells.radiance(arriving, reflectance, paths.first, paths.last, is_preview=is_preview)


def _between_surfaces(light: Light) -> Light:
    """All of a light that cells depend on."""
    return light._replace(paths=light.paths.without_direct())
