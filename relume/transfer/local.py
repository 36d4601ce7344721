"""Local lights over a baked store: their shadows are traced when a look asks for them, and remembered by who asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from relume.light.local import LocalLight, Triangles, make_local, pattern_of, shadow_geometry
from relume.look import LightGeometry
from relume.trace.cells import POINTS_A_CELL
from relume.trace.embree import EmbreeScene
from relume.trace.geometry import is_front, off_surface
from relume.trace.local_shadows import arriving, trace_local
from relume.trace.rough_light import RoughLight, light_roughly
from relume.transfer.base import StoreReader
from relume.transfer.light import Light, Source
from relume.transfer.receivers import LocalRays

F32 = NDArray[np.float32]

SAMPLES, SAMPLES_OF_CELLS = 64, 16  # of a rectangle: for each view sample, for each point of a cell
ROUGH_SAMPLES = 4  # for each of both while a hand moves it
_LIGHTS_KEPT = 256


@dataclass(frozen=True)
class Points:
    """Points that shadow rays start from.

    Attributes:
        position: off the surface. normal: shading normals. (n, 3) float32
        numbers: seed their samples of lights. (n,) uint32
    """

    position: F32
    normal: F32
    numbers: NDArray[np.uint32]


@dataclass(frozen=True)
class Shadows:
    """Samples of a light that points see, as in `LocalRays.visible`."""

    visible: NDArray[np.uint8]

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.visible.nbytes


class LocalLights:
    """The triangles of a store, and lights among them; shared by all pictures of the bake."""

    def __init__(self, store: StoreReader) -> None:
        self._store = store
        self._light = lru_cache(_LIGHTS_KEPT)(self._make)
        self.irradiance = lru_cache(_LIGHTS_KEPT)(self._irradiance)
        self.rough_irradiance = lru_cache(_LIGHTS_KEPT)(self._rough_irradiance)

    @cached_property
    def _positions(self) -> F32:
        return np.asarray(self._store.read("scene/positions"), np.float32)

    @cached_property
    def _faces(self) -> NDArray[np.uint32]:
        return np.asarray(self._store.read("scene/faces"), np.uint32)

    @cached_property
    def _embree(self) -> EmbreeScene:
        return EmbreeScene.build(self._positions, self._faces)

    @cached_property
    def _off_surface(self) -> float:
        return off_surface(self._positions)

    def all_rays(
        self,
        light: Light,
        points: Points,
        shadows_of: Callable[[LightGeometry, Points], Shadows] | None = None,
    ) -> list[LocalRays]:
        """Local light that comes straight to points.

        Args:
            shadows_of: where they are remembered; they are traced where there is no such place.
        """
        if not light.paths.direct:
            return []
        find = shadows_of or self.shadows
        return [
            LocalRays(
                self._light(geometry),
                pattern_of(geometry, SAMPLES),
                np.array(gain, np.float32),
                points.position,
                points.numbers,
                find(shadow_geometry(geometry), points).visible,
            )
            for geometry, gain in light.local
        ]

    def roughly(self, geometry: LightGeometry, points: Points) -> RoughLight:
        """What comes to points from a light of unit emission, few samples of it where it has an extent."""
        pattern, along = pattern_of(geometry, ROUGH_SAMPLES), (points.position, points.normal, points.numbers)
        return light_roughly(self._embree, self._off_surface, self._light(geometry), pattern, *along)

    def rough_rays(self, source: Source, points: Points, seen: NDArray[np.uint8]) -> LocalRays:
        """The same as rays, for terms that ask where light comes from. seen: of `RoughLight`"""
        light, pattern = self._light(source.geometry), pattern_of(source.geometry, ROUGH_SAMPLES)
        return LocalRays(light, pattern, np.array(source.gain, np.float32), points.position, points.numbers, seen)

    def unhidden(self, geometry: LightGeometry, points: Points) -> F32:
        """What would come to points from a light of unit emission if nothing were in its way. (n,) float32"""
        pattern = pattern_of(geometry, SAMPLES)
        seen = np.full((len(points.position), -(-len(pattern.uv) // 8)), 255, np.uint8)
        return arriving(self._light(geometry), pattern, points.position, points.normal, points.numbers, seen)

    def shadows(self, geometry: LightGeometry, points: Points) -> Shadows:
        """What points see of a light."""
        return Shadows(self._trace(geometry, points, SAMPLES))

    @cached_property
    def _cells(self) -> Points:
        """The points that stand for gather cells, those of a cell one after another."""
        position, normal = (self._store.read(f"cells/{name}").reshape(-1, 3) for name in ("position", "normal"))
        return Points(position, normal, np.arange(len(position), dtype=np.uint32))

    @cached_property
    def _few_cells(self) -> Points:
        """One of each cell's points."""
        return Points(*(np.ascontiguousarray(a[::POINTS_A_CELL]) for a in vars(self._cells).values()))

    def _irradiance(self, geometry: LightGeometry) -> F32:
        """What comes to every gather cell from a light of unit emission, the mean over its points. (C,) float32"""
        points, pattern = self._cells, pattern_of(geometry, SAMPLES_OF_CELLS)
        seen = self._trace(geometry, points, SAMPLES_OF_CELLS)
        along = (points.position, points.normal, points.numbers, seen)
        of_points = arriving(self._light(geometry), pattern, *along).reshape(-1, POINTS_A_CELL)
        return np.asarray(of_points.mean(axis=1, dtype=np.float64), np.float32)

    def _rough_irradiance(self, geometry: LightGeometry) -> F32:
        """The same for a moving hand, at one of a cell's points."""
        return self.roughly(geometry, self._few_cells).arriving

    def shines_at(self, material: int, eye: F32, position: F32) -> NDArray[np.bool_]:
        """Whether points (n, 3) of a material that shines are seen from a side that does."""
        if self._is_two_sided(material):
            return np.ones(len(position), np.bool_)
        return is_front(self._embree, self._positions, self._faces, eye, position)

    def _trace(self, geometry: LightGeometry, points: Points, num_samples: int) -> NDArray[np.uint8]:
        light, pattern = self._light(geometry), pattern_of(geometry, num_samples)
        along = (points.position, points.normal, points.numbers)
        return trace_local(self._embree, self._off_surface, light, pattern, *along)

    def _make(self, geometry: LightGeometry) -> LocalLight:
        if geometry.kind != "mesh":
            return make_local(geometry)
        material = list(self._store.attributes["materials"]).index(geometry.material)
        faces = self._faces[self._store.read("scene/face_material") == material]
        return make_local(geometry, Triangles(self._positions[faces], self._is_two_sided(material)))

    def _is_two_sided(self, material: int) -> bool:
        return bool(self._store.attributes["double_sided"][material])
