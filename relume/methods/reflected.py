"""What the gather cells of a bake send out under the lights of its pictures, computed once for all of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relume.memory import Memory
from relume.methods.cells.between import preview_between, quickly_between, sent_between
from relume.methods.cells.in_lobes import sent_in_lobes
from relume.methods.cells.leaving import InLobes, Leaving
from relume.methods.cells.reflecting import Reflecting
from relume.methods.on_cells import LightOnCells
from relume.picture.light import Light, Normals, is_same_but_for_surfaces
from relume.project.sent import Sent, evenly
from relume.trace.cell_tree import NO_CELL

F32 = NDArray[np.float32]


class Reflected:
    """Light that cells send; safe to use from several threads.

    What follows a hand is of the normals that were baked: it is made of both ends of an edit alike.

    Args:
        on_cells: what comes to them from the lights themselves.
        leaning: finds the same where images lean materials, by the image of each.
        key: of the bake in `memory`.
    """

    def __init__(
        self,
        on_cells: LightOnCells,
        leaning: Callable[[Normals], LightOnCells],
        memory: Memory,
        key: str,
    ) -> None:
        self._on_cells, self._leaning, self._cells = on_cells, leaning, on_cells.cells
        self.num_cells = self._cells.num_cells
        self._memory, self._key = memory, key

    def under(self, light: Light) -> Sent:
        """What exact pictures show."""
        between = _between_surfaces(light)
        return self._memory.keep((self._key, "reflected light", between), lambda: self._sent(between))

    def beside(self, light: Light, taken: Callable[[Light], Leaving]) -> Sent:
        """The same without what `taken` finds of it: what is shown of that is found otherwise."""
        between = _between_surfaces(light)

        def found() -> Sent:
            return self._leaving(between).less(taken(between)).sent(self._exactly_on(between).cells)

        return self._memory.keep((self._key, "reflected light beside what is thrown", between), found)

    def preview_under(self, light: Light) -> F32:
        """What pictures follow while a hand moves, the same in every direction; waits for nobody who wants something
        exact. (NO_CELL + 1, 3) float32"""
        between = _between_surfaces(light)
        key = self._key, "reflected light for a preview", between
        return self._memory.passing.keep(key, lambda: self._preview(between))

    def quickly_under(self, light: Light) -> Sent:
        """What moving pictures follow while a hand moves a light."""
        return self._quickly(_between_surfaces(light), is_preview=True).sent(self._cells)

    def preview_change(self, before: Light, after: Light) -> F32:
        """How much more cells send, the same in every direction; both ends alike, so that what is wrong with both
        cancels. Where surfaces alone have changed, highlights give light directions on its way between cells, and
        what others see of each in the mean is what is left of them in the end. (C, 3) float32"""
        if is_same_but_for_surfaces(before, after):
            return self._change(before, after).seen(self._cells)
        change = self.preview_under(after) - self.preview_under(before)
        return change[: self.num_cells]

    def change(self, before: Light, after: Light) -> Sent:
        """How what cells send changes, found quickly, where the lights themselves are as before and their light on
        cells is found exactly; both ends alike, so that what is wrong with both cancels.

        Args:
            before, after: of equal sources.
        """
        return self._change(before, after, is_sharp=True).sent(self._cells)

    def _change(self, before: Light, after: Light, *, is_sharp: bool = False) -> Leaving:
        here, there = (
            self._quickly(_between_surfaces(light), is_preview=False, is_sharp=is_sharp) for light in (before, after)
        )
        return there.less(here)

    def _quickly(self, light: Light, *, is_preview: bool, is_sharp: bool = False) -> Leaving:
        """What cells send. is_preview: lights are found quickly. is_sharp: sharp highlights go by tables."""

        def found() -> Leaving:
            reflecting = self._reflecting(light, self._memory.passing)
            arrived = self._on_cells.arrived(light, reflecting, is_preview=is_preview)
            in_lobes = self._in_lobes(light, reflecting, self._on_cells) if is_sharp else None
            return quickly_between(self._cells, reflecting, arrived, light.paths.first, light.paths.last, in_lobes)

        key = self._key, "reflected light, quickly", light, is_preview, is_sharp
        return self._memory.passing.keep(key, found)

    def _sent(self, light: Light) -> Sent:
        if not light.paths.reflect:
            return evenly(np.zeros((NO_CELL + 1, 3), np.float32))
        return self._leaving(light).sent(self._exactly_on(light).cells)

    def _exactly_on(self, light: Light) -> LightOnCells:
        """What comes to cells, which lean as the look says."""
        return self._leaning(light.normals) if any(light.normals) else self._on_cells

    def _leaving(self, light: Light) -> Leaving:
        reflecting, on_cells = self._reflecting(light, self._memory), self._exactly_on(light)
        arrived = on_cells.arrived(light, reflecting, is_preview=False)
        in_lobes = self._in_lobes(light, reflecting, on_cells)
        return sent_between(on_cells.cells, reflecting, arrived, light.paths.first, light.paths.last, in_lobes)

    @staticmethod
    def _in_lobes(light: Light, reflecting: Reflecting, on_cells: LightOnCells) -> InLobes:
        """What sharp highlights send of light that comes straight to them."""
        lobes = on_cells.cells.lobes(light.reflectances, reflecting)
        return lobes, sent_in_lobes(on_cells.cells, lobes, on_cells.straight(light, lobes.rows))

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
