"""What the gather cells of a bake send out under the lights of its pictures, computed once for all of them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from relume.trace.cell_tree import NO_CELL
from relume.transfer.gathered import CellLight
from relume.transfer.light import Light

F32 = NDArray[np.float32]

_LIGHTS_KEPT = 4


class Reflected:
    """Radiance of cells under a light, (NO_CELL + 1, 3) float32; safe to use from several threads.

    Args:
        irradiance: that comes to the cells from the lights themselves, or roughly does. (C, 3) float32
    """

    def __init__(self, cells: CellLight, irradiance: Callable[[Light, bool], F32]) -> None:
        self.num_cells = cells.num_cells
        self._lock = threading.Lock()

        def radiance(light: Light, roughly: bool) -> F32:
            paths = light.paths
            if not paths.reflect:
                return np.zeros((NO_CELL + 1, 3), np.float32)
            arriving = irradiance(light, roughly)
            return cells.radiance(arriving, light.reflectances, paths.first, paths.last, roughly=roughly)

        self._exactly = lru_cache(maxsize=_LIGHTS_KEPT)(lambda light: radiance(light, False))
        self._roughly = lru_cache(maxsize=_LIGHTS_KEPT)(lambda light: radiance(light, True))

    def under(self, light: Light) -> F32:
        """What exact pictures show."""
        with self._lock:  # all who want the same wait for one
            return self._exactly(_between_surfaces(light))

    def roughly_under(self, light: Light) -> F32:
        """What pictures follow while a hand moves; waits for nobody."""
        return self._roughly(_between_surfaces(light))


def _between_surfaces(light: Light) -> Light:
    """All of a light that cells depend on."""
    return light._replace(paths=light.paths.without_straight())
