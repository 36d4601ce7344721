"""What the gather cells of a bake send out under the lights of its pictures, computed once for all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.memory import Memory
from relume.methods.cells.between import preview_between, sent_between
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.reflecting import Reflecting
from relume.methods.on_cells import LightOnCells
from relume.picture.light import Light
from relume.project.sent import Sent, evenly
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]


class Reflected:
    """Light that cells send; safe to use from several threads.

    Args:
        cells: that send it.
        on_cells: what comes to them from the lights themselves.
        key: of the bake in `memory`.
    """

    def __init__(self, cells: CellLight, on_cells: LightOnCells, memory: Memory, key: str) -> None:
        self.num_cells = cells.num_cells
        self._cells, self._on_cells = cells, on_cells
        self._memory, self._key = memory, key

    def under(self, light: Light) -> Sent:
        """What exact pictures show."""
        between = _between_surfaces(light)
        return self._memory.keep((self._key, "reflected light", between), lambda: self._sent(between))

    def preview_under(self, light: Light) -> F32:
        """What pictures follow while a hand moves, the same in every direction; waits for nobody who wants something
        exact. (NO_CELL + 1, 3) float32"""
        between = _between_surfaces(light)
        key = self._key, "reflected light for a preview", between
        return self._memory.passing.keep(key, lambda: self._preview(between))

    def _sent(self, light: Light) -> Sent:
        if not light.paths.reflect:
            return evenly(np.zeros((NO_CELL + 1, 3), np.float32))
        reflecting = self._reflecting(light, self._memory)
        arrived = self._on_cells.arrived(light, reflecting, is_preview=False)
        return sent_between(self._cells, reflecting, arrived, light.paths.first, light.paths.last)

    def _preview(self, light: Light) -> F32:
        if not light.paths.reflect:
            return np.zeros((NO_CELL + 1, 3), np.float32)
        reflecting = self._reflecting(light, self._memory.passing)
        arrived = self._on_cells.arrived(light, reflecting, is_preview=True)
        return preview_between(self._cells, reflecting, arrived, light.paths.first, light.paths.last)

    def _reflecting(self, light: Light, memory: Memory) -> Reflecting:
        key, chosen = (self._key, "reflectance", light.reflectances), light.reflectances
        return memory.keep(key, lambda: self._cells.reflecting(chosen))


def _between_surfaces(light: Light) -> Light:
    """All of a light that cells depend on."""
    return light._replace(paths=light.paths.without_direct())
