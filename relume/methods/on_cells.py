"""What the lights themselves bring to gather cells, before any surface has reflected it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import SENT_DEGREE
from relume.light.local import LocalLight, shadow_geometry
from relume.light.strata import Strata
from relume.light.triangles import TriangleLights
from relume.look import EnvironmentKey, LightGeometry
from relume.memory import Memory
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.in_lobes import Coming
from relume.methods.cells.reflecting import Arrived, Reflecting
from relume.methods.harmonic_light import CELL_DEGREE, HarmonicLight
from relume.methods.local_lights import LocalLights
from relume.picture.light import Light, Source
from relume.project.light_vectors import ray_vectors
from relume.project.receivers import LocalRays
from relume.project.sent import NUM_SENT
from relume.trace.local_shadows import arriving
from relume.trace.preview_light import PreviewLight

F32 = NDArray[np.float32]

SAMPLES_OF_CELLS = 16  # of a rectangle, for each point of a cell


class LocalOnCells:
    """What local lights bring to gather cells, each of unit emission.

    Args:
        local: the lights. cells: that they shine on.
        memory: of all that is made from the bake. key: of the bake in it. leaning: see `LightOnCells`.
    """

    def __init__(
        self, local: LocalLights, cells: CellLight, memory: Memory, key: str, leaning: tuple[Hashable, ...]
    ) -> None:
        self._local, self._cells = local, cells
        self._memory, self._key, self._leaning = memory, key, leaning

    def irradiance(self, geometry: LightGeometry) -> F32:
        """What comes to every cell, the mean over its points. (C,) float32"""
        key = self._key, "light on cells", geometry, *self._leaning
        return self._memory.keep(key, lambda: self._irradiance(geometry))

    def _irradiance(self, geometry: LightGeometry) -> F32:
        of_points = arriving(*self._sampled(geometry), self._cells.points, self._seen(geometry))
        shape = self._cells.num_cells, self._cells.points_a_cell
        return np.asarray(of_points.reshape(shape).mean(axis=1, dtype=np.float64), np.float32)

    def _seen(self, geometry: LightGeometry) -> NDArray[np.uint8]:
        def traced() -> NDArray[np.uint8]:
            return self._local.trace(geometry, self._cells.points, self._local.samples_of(geometry, SAMPLES_OF_CELLS))

        return self._memory.keep((self._key, "shadows on cells", shadow_geometry(geometry), *self._leaning), traced)

    def rays(self, geometry: LightGeometry, rows: NDArray[np.intp]) -> LocalRays:
        """What comes to the points of some cells, as rays.

        Args:
            geometry: of the light. rows: the cells. (G,)
        """
        seen, num = self._seen(geometry), self._cells.points_a_cell
        bits = seen.reshape(-1, num, seen.shape[1])[rows].reshape(-1, seen.shape[1])
        return LocalRays(*self._sampled(geometry), np.ones(3, np.float32), bits)

    def preview_irradiance(self, geometry: LightGeometry) -> F32:
        """Preview what comes to every cell, at one of its points. (C,) float32"""
        return self._preview(geometry).arriving

    def preview_rays(self, geometry: LightGeometry, rows: NDArray[np.intp]) -> LocalRays:
        """The same of some cells as rays, at the first of their points. rows: the cells. (G,)"""
        return self._local.preview_rays(Source(geometry, (1.0, 1.0, 1.0)), self._preview(geometry).visible[rows])

    def _preview(self, geometry: LightGeometry) -> PreviewLight:
        key, every = (self._key, "preview light on cells", geometry, *self._leaning), np.arange(self._cells.num_cells)
        return self._memory.passing.keep(key, lambda: self._local.preview(geometry, self._cells.first_points(every)))

    def _sampled(self, geometry: LightGeometry) -> tuple[LocalLight, Strata]:
        return self._local.sampled(geometry, self._local.samples_of(geometry, SAMPLES_OF_CELLS))


class LightOnCells:
    """Found for one source after another, and kept: transport is linear in them.

    Args:
        cells: that it comes to. local: local lights. lights_in: finds the triangles of an environment.
        preview_lights_in: finds them quickly.
        memory: of all that is made from the bake. key: of the bake in it.
        harmonic: transfer of smooth light, for previews; None where a bake has none.
        leaning: names how cells lean that lean otherwise than they were baked; empty for those that were.
    """

    def __init__(
        self,
        cells: CellLight,
        local: LocalLights,
        lights_in: Callable[[EnvironmentKey], TriangleLights],
        preview_lights_in: Callable[[EnvironmentKey], TriangleLights],
        memory: Memory,
        key: str,
        harmonic: HarmonicLight | None = None,
        leaning: tuple[Hashable, ...] = (),
    ) -> None:
        self.cells, self._local = cells, LocalOnCells(local, cells, memory, key, leaning)
        self._lights_in, self._preview_lights_in = lights_in, preview_lights_in
        self._memory, self._key, self._harmonic, self._leaning = memory, key, harmonic, leaning

    def arrived(self, light: Light, reflecting: Reflecting, *, is_preview: bool) -> Arrived:
        """Sum what all sources bring.

        Args:
            light: all that shines. reflecting: tells which cells ask where light comes from.
            is_preview: local lights by few samples, large environments by small maps, directions roughly.
        """
        out = Arrived(
            np.zeros((self.cells.num_cells, 3), np.float32),
            np.zeros((len(reflecting.rows), 3, NUM_SENT), np.float32),
        )
        of_local = self._local.preview_irradiance if is_preview else self._local.irradiance
        if light.is_environment_lit:
            gain = np.array(light.environment_gain, np.float32)
            out.irradiance[:] += gain * self._irradiance(light.environment, is_preview)
            out.vectors[:] += gain[:, None] * self._vectors(light.environment, reflecting, is_preview)
        for geometry, of_light in light.local:
            gain = np.array(of_light, np.float32)
            out.irradiance[:] += gain * of_local(geometry)[:, None]
            out.vectors[:] += gain[:, None] * self._local_vectors(geometry, reflecting, is_preview)
        return out

    def straight(self, light: Light, rows: NDArray[np.intp]) -> Coming:
        """What comes to the points of some cells, exactly, source after source. rows: the cells. (G,)"""
        of_local = ((self._local.rays(geometry, rows), gain) for geometry, gain in light.local)
        rays = [replace(rays, gain=np.array(gain, np.float32)) for rays, gain in of_local]
        if not light.is_environment_lit:
            return Coming(rays=rays)
        lights = self._lights_in(light.environment)
        gain = np.array(light.environment_gain, np.float32)
        return Coming(replace(lights, irradiance=gain * lights.irradiance), self.cells.seen_by(rows), rays)

    def _irradiance(self, environment: EnvironmentKey, is_preview: bool) -> F32:
        key = self._key, "environment on cells", environment, *self._leaning
        if not is_preview or self._memory.holds(key):
            return self._memory.keep(key, lambda: self.cells.irradiance(self._lights_in(environment)))
        quick = *key, "for a preview"
        return self._memory.passing.keep(quick, lambda: self._quick_irradiance(environment))

    def _quick_irradiance(self, environment: EnvironmentKey) -> F32:
        lights, harmonic = self._preview_lights_in(environment), self._harmonic
        if harmonic is None:
            return self.cells.irradiance(lights)
        divided = harmonic.divided(lights)
        beyond = self.cells.irradiance(divided.beyond, divided.chosen)
        return beyond + harmonic.irradiance @ divided.smooth

    def _vectors(self, environment: EnvironmentKey, reflecting: Reflecting, is_preview: bool) -> F32:
        cells, rows = self.cells, reflecting.rows
        key = self._key, "environment on cells, by direction", environment, reflecting.has_lobe, *self._leaning
        if is_preview:
            quick = *key, "for a preview"
            return self._memory.passing.keep(quick, lambda: self._quick_vectors(environment, rows))
        return self._memory.keep(key, lambda: cells.vectors(rows, self._lights_in(environment), SENT_DEGREE))

    def _quick_vectors(self, environment: EnvironmentKey, rows: NDArray[np.intp]) -> F32:
        lights, harmonic, cells = self._preview_lights_in(environment), self._harmonic, self.cells
        if harmonic is None:
            return cells.vectors(rows, lights, CELL_DEGREE)
        divided = harmonic.divided(lights)
        beyond = cells.vectors(rows, divided.beyond, CELL_DEGREE, divided.chosen)
        smooth = np.einsum("gkl,lc->gck", harmonic.vectors[rows], divided.smooth)
        return beyond + cells.vectors_of(rows, cells.first_points(rows), smooth)

    def _local_vectors(self, geometry: LightGeometry, reflecting: Reflecting, is_preview: bool) -> F32:
        """Of a light of unit emission; for a preview at one point of each cell. (G, 3, J) float32"""
        cells, rows = self.cells, reflecting.rows

        def found() -> F32:
            if is_preview:
                points, rays = cells.first_points(rows), self._local.preview_rays(geometry, rows)
            else:
                points, rays = cells.points_of(rows), self._local.rays(geometry, rows)
            return cells.vectors_of(rows, points, ray_vectors(points, [rays], SENT_DEGREE))

        memory, named = self._memory.passing if is_preview else self._memory, "light on cells, by direction"
        return memory.keep((self._key, named, geometry, reflecting.has_lobe, is_preview, *self._leaning), found)
