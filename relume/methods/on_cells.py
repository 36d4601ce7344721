"""What the lights themselves bring to gather cells, before any surface has reflected it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.basis.zernike import SENT_DEGREE
from relume.light.triangles import TriangleLights
from relume.look import EnvironmentKey, LightGeometry
from relume.memory import Memory
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.in_lobes import Coming
from relume.methods.cells.reflecting import Arrived, Reflecting
from relume.methods.harmonic_light import CELL_DEGREE, HarmonicLight
from relume.methods.local_lights import LocalLights
from relume.picture.light import Light
from relume.project.light_vectors import ray_vectors
from relume.project.sent import NUM_SENT

F32 = NDArray[np.float32]


class LightOnCells:
    """Found for one source after another, and kept: transport is linear in them.

    Args:
        cells: that it comes to. local: local lights. lights_in: finds the triangles of an environment.
        preview_lights_in: finds them quickly.
        memory: of all that is made from the bake. key: of the bake in it.
        harmonic: transfer of smooth light, for previews; None where a bake has none.
    """

    def __init__(
        self,
        cells: CellLight,
        local: LocalLights,
        lights_in: Callable[[EnvironmentKey], TriangleLights],
        preview_lights_in: Callable[[EnvironmentKey], TriangleLights],
        memory: Memory,
        key: str,
        harmonic: HarmonicLight | None,
    ) -> None:
        self._cells, self._local = cells, local
        self._lights_in, self._preview_lights_in = lights_in, preview_lights_in
        self._memory, self._key, self._harmonic = memory, key, harmonic

    def arrived(self, light: Light, reflecting: Reflecting, *, is_preview: bool) -> Arrived:
        """Sum what all sources bring.

        Args:
            light: all that shines. reflecting: tells which cells ask where light comes from.
            is_preview: local lights by few samples, large environments by small maps, directions roughly.
        """
        out = Arrived(
            np.zeros((self._cells.num_cells, 3), np.float32),
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
        of_local = ((self._local.rays_at_cells(geometry, rows), gain) for geometry, gain in light.local)
        rays = [replace(rays, gain=np.array(gain, np.float32)) for rays, gain in of_local]
        if not light.is_environment_lit:
            return Coming(rays=rays)
        lights = self._lights_in(light.environment)
        gain = np.array(light.environment_gain, np.float32)
        return Coming(replace(lights, irradiance=gain * lights.irradiance), self._cells.seen_by(rows), rays)

    def _irradiance(self, environment: EnvironmentKey, is_preview: bool) -> F32:
        key = self._key, "environment on cells", environment
        if not is_preview or self._memory.holds(key):
            return self._memory.keep(key, lambda: self._cells.irradiance(self._lights_in(environment)))
        quick = *key, "for a preview"
        return self._memory.passing.keep(quick, lambda: self._quick_irradiance(environment))

    def _quick_irradiance(self, environment: EnvironmentKey) -> F32:
        lights, harmonic = self._preview_lights_in(environment), self._harmonic
        if harmonic is None:
            return self._cells.irradiance(lights)
        divided = harmonic.divided(lights)
        beyond = self._cells.irradiance(divided.beyond, divided.chosen)
        return beyond + harmonic.irradiance @ divided.smooth

    def _vectors(self, environment: EnvironmentKey, reflecting: Reflecting, is_preview: bool) -> F32:
        cells, rows = self._cells, reflecting.rows
        key = self._key, "environment on cells, by direction", environment, reflecting.has_lobe
        if is_preview:
            quick = *key, "for a preview"
            return self._memory.passing.keep(quick, lambda: self._quick_vectors(environment, rows))
        return self._memory.keep(key, lambda: cells.vectors(rows, self._lights_in(environment), SENT_DEGREE))

    def _quick_vectors(self, environment: EnvironmentKey, rows: NDArray[np.intp]) -> F32:
        lights, harmonic, cells = self._preview_lights_in(environment), self._harmonic, self._cells
        if harmonic is None:
            return cells.vectors(rows, lights, CELL_DEGREE)
        divided = harmonic.divided(lights)
        beyond = cells.vectors(rows, divided.beyond, CELL_DEGREE, divided.chosen)
        smooth = np.einsum("gkl,lc->gck", harmonic.vectors[rows], divided.smooth)
        return beyond + cells.vectors_of(rows, cells.first_points(rows), smooth)

    def _local_vectors(self, geometry: LightGeometry, reflecting: Reflecting, is_preview: bool) -> F32:
        """Of a light of unit emission; for a preview at one point of each cell. (G, 3, J) float32"""
        cells, rows = self._cells, reflecting.rows

        def found() -> F32:
            if is_preview:
                points, rays = cells.first_points(rows), self._local.preview_rays_at_cells(geometry, rows)
            else:
                points, rays = cells.points_of(rows), self._local.rays_at_cells(geometry, rows)
            return cells.vectors_of(rows, points, ray_vectors(points, [rays], SENT_DEGREE))

        memory = self._memory.passing if is_preview else self._memory
        return memory.keep(
            (self._key, "light on cells, by direction", geometry, reflecting.has_lobe, is_preview), found
        )
