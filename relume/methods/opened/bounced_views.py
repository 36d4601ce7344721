"""Bakes of fixed views in which light comes from other surfaces, too, opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.memory import Memory
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.leaning import leant_cells
from relume.methods.harmonic_light import HarmonicLight, read_harmonic_light
from relume.methods.local_lights import LocalLights
from relume.methods.on_cells import LightOnCells
from relume.methods.opened.baked_views import BakedViews, FewSamples, Lights
from relume.methods.reflected import Reflected
from relume.methods.retracing import Retracing
from relume.methods.thrown import MoreThrown, Thrown, ThrownLight
from relume.picture.light import Light, Normals
from relume.picture.transfer import Axis
from relume.project.receivers import GatherRays, Rays
from relume.project.sent import evenly
from relume.trace.cell_tree import NO_CELL
from relume.views.view import View

_NOTHING = evenly(np.zeros((NO_CELL + 1, 3), np.float32))


@dataclass(frozen=True)
class BouncedViews(BakedViews):
    """A bake of fixed views in which light comes from other surfaces, too.

    Attributes:
        cells: gather cells, which send it.
        thrown: what flat mirrors send exactly; None where there are none.
    """

    cells: CellLight
    thrown: Thrown | None

    axes = BakedViews.axes | {Axis.BOUNCES}

    @cached_property
    def reflected(self) -> Reflected:
        """Light that gather cells send out."""
        on_cells = LightOnCells(self.cells, *self._on_cells, self.harmonic)
        return Reflected(on_cells, self._on_leant_cells, self.memory, self.key)

    def _on_leant_cells(self, normals: Normals) -> LightOnCells:
        """The light on cells of which some lean as images say. normals: the image of each material, None for none"""
        return LightOnCells(self._leant_cells(normals), *self._on_cells, leaning=(normals,))

    def _leant_cells(self, normals: Normals, cancelled: Callable[[], bool] = lambda: False) -> CellLight:
        key = self.key, "cells that lean", normals
        return self.memory.keep(key, lambda: leant_cells(self.cells, normals, self.tracer, cancelled))

    def trace_cells(self, light: Light, cancelled: Callable[[], bool]) -> None:
        """Trace what cells lack that lean otherwise than they were baked. See `Transfer`."""
        if any(normals := light.normals):
            self._leant_cells(normals, cancelled)

    @property
    def _on_cells(self) -> tuple[LocalLights, Lights, Lights, Memory, str]:
        """What light comes to cells, and where it is kept."""
        return self.local, self.lights_in, self.preview_lights_in, self.memory, self.key

    @cached_property
    def thrown_light(self) -> ThrownLight | None:
        """The same in any look."""
        if self.thrown is None:
            return None
        return ThrownLight(self.thrown, self.cells, self.lights_in, self.memory, self.key)

    @cached_property
    def tracer(self) -> Retracing:
        """Rays for normals that the bake did not know."""
        return Retracing(self.store, self.local, self.thrown)

    @cached_property
    def harmonic(self) -> HarmonicLight | None:
        """How smooth light comes to points and cells, where that was baked."""
        return read_harmonic_light(self.store, self.cells)

    def _rays(self, view: View, material: int, light: Light, memory: Memory) -> Sequence[Rays]:
        """The rays among what arrives: those of gather cells, and of local lights."""
        local = super()._rays(view, material, light, memory)
        if not light.paths.reflect:
            return local
        rays, seen = view.gather_rays(material, _NOTHING), self.thrown_to(view, material)
        return (*self.between_surfaces(light, rays, seen), *local)

    def between_surfaces(
        self, light: Light, gathered: GatherRays, thrown: NDArray[np.uint8] | None
    ) -> tuple[Rays, ...]:
        """The rays of samples that bring what surfaces send. See `BakedViews`."""
        by_mirrors = self.thrown_light
        if thrown is None or by_mirrors is None or not by_mirrors.is_in(light):
            return super().between_surfaces(light, gathered, thrown)
        beside = self.reflected.beside(light, by_mirrors.taken)
        return replace(gathered, sent=beside), by_mirrors.rays(light, thrown)

    def thrown_to(self, view: View, material: int) -> NDArray[np.uint8] | None:
        """The lights that a material's samples see in flat mirrors. (n, bytes) uint8"""
        if self.thrown is None:
            return None
        rows = view.rows(material)

        def read() -> NDArray[np.uint8]:
            return view.store.read(f"views/{view.index}/thrown", rows.start, rows.stop)

        return self.memory.passing.keep((self.key, "thrown", *view.place(material)), read)

    def more_thrown(self, before: Light, after: Light) -> MoreThrown | None:
        """How much more flat mirrors throw after than before. See `Transfer`."""
        return None if self.thrown_light is None else self.thrown_light.more(before, after)

    def some(self, view: View, material: int, chosen: NDArray[np.integer], *, reflects: bool) -> FewSamples:
        """Some of a material's samples. See `Transfer`."""
        few = super().some(view, material, chosen, reflects=reflects)
        if not reflects:
            return few
        thrown = None if self.thrown is None else np.asarray(view.read_some("thrown", material, chosen), np.uint8)
        return replace(few, gathered=view.some_gather_rays(material, chosen, _NOTHING), thrown=thrown)
