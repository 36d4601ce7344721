"""Local lights over a baked store: their shadows are traced when a look asks for them, and remembered by who asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.bake import StoreReader
from relume.light.local import LocalLight, Triangles, make_local, shadow_geometry, strata_of
from relume.light.strata import Strata
from relume.look import LightGeometry
from relume.memory import Memory
from relume.methods.store_io import has_holes, read_holes
from relume.picture.light import Light, Source
from relume.points import Points
from relume.project.receivers import LocalRays
from relume.trace.embree import EmbreeScene
from relume.trace.geometry import is_front, off_surface
from relume.trace.local_shadows import arriving, trace_local
from relume.trace.preview_light import PreviewLight, preview_light

F32 = NDArray[np.float32]

SAMPLES = 64  # of a rectangle, for each view sample
FINER_OF_FEW, FEW = 4, 4  # times as many of a mesh, where no more materials of the scene shine
PREVIEW_SAMPLES = 4  # while a hand moves it
_ONES = np.ones(3, np.float32)


@dataclass(frozen=True)
class Shadows:
    """Samples of a light that points see, as in `LocalRays.visible`."""

    visible: NDArray[np.uint8]

    @property
    def num_bytes(self) -> int:
        """Memory it holds."""
        return self.visible.nbytes


class LocalLights:
    """The triangles of a store, and lights among them; shared by all pictures of the bake.

    Args:
        key: of the bake in `memory`.
    """

    def __init__(self, store: StoreReader, memory: Memory, key: str) -> None:
        self._store, self._memory, self._key = store, memory, key

    @cached_property
    def positions(self) -> F32:
        """Corners of the scene's triangles. (num_vertices, 3) float32"""
        return np.asarray(self._store.read("scene/positions"), np.float32)

    @cached_property
    def faces(self) -> NDArray[np.uint32]:
        """The triangles. (num_faces, 3) uint32"""
        return np.asarray(self._store.read("scene/faces"), np.uint32)

    @property
    def has_holes(self) -> bool:
        """Whether rays may pass some of them."""
        return has_holes(self._store)

    @cached_property
    def embree(self) -> EmbreeScene:
        """Their search tree."""
        return EmbreeScene.build(self.positions, self.faces, read_holes(self._store, self.positions, self.faces))

    @cached_property
    def _off_surface(self) -> float:
        return off_surface(self.positions)

    def samples_of(self, geometry: LightGeometry, of_rectangle: int = SAMPLES) -> int:
        """How many samples a light has where a rectangle has so many, see `strata_of`: more of a mesh, of which walls
        hide parts, and which is near to the frame that it stands in."""
        lights = self._store.attributes["look"]["lights"].values()
        is_one_of_few = sum(light["kind"] == "mesh" for light in lights) <= FEW
        return of_rectangle * (FINER_OF_FEW if geometry.kind == "mesh" and is_one_of_few else 1)

    def all_rays(
        self,
        light: Light,
        points: Points,
        shadows_of: Callable[[LightGeometry, Points], Shadows] | None = None,
        *,
        is_coarse: bool = False,
    ) -> list[LocalRays]:
        """Find the local light that comes directly to points, as rays.

        Args:
            light: all that arrives at the picture. points: where it arrives.
            shadows_of: where they are remembered; they are traced where there is no such place.
            is_coarse: without it, for broad functions of where light comes from; every light has `SAMPLES`.
        """
        if not light.paths.direct:
            return []
        found = []
        for geometry, gain in light.local:
            num, shadow = SAMPLES if is_coarse else self.samples_of(geometry), shadow_geometry(geometry)
            seen = self.trace(shadow, points, num) if shadows_of is None else shadows_of(shadow, points).visible
            found.append(LocalRays(*self.sampled(geometry, num), np.array(gain, np.float32), seen))
        return found

    def preview(self, geometry: LightGeometry, points: Points) -> PreviewLight:
        """Preview what points get of a light of unit emission, by few samples of it where it has an extent."""
        return preview_light(self.embree, self._off_surface, *self.sampled(geometry, PREVIEW_SAMPLES), points)

    def preview_rays(self, source: Source, seen: NDArray[np.uint8]) -> LocalRays:
        """Make rays of a previewed light, for terms that ask where light comes from. seen: `PreviewLight.visible`"""
        return LocalRays(*self.sampled(source.geometry, PREVIEW_SAMPLES), np.array(source.gain, np.float32), seen)

    def unhidden_rays(self, geometry: LightGeometry, points: Points) -> LocalRays:
        """What would come to points from a light of unit emission if nothing were in its way, as rays."""
        light, strata = self.sampled(geometry, SAMPLES)
        seen = np.full((points.num_points, -(-len(strata.uv) // 8)), 255, np.uint8)
        return LocalRays(light, strata, _ONES, seen)

    def unhidden(self, geometry: LightGeometry, points: Points) -> F32:
        """What would come to points from a light of unit emission if nothing were in its way. (n,) float32"""
        rays = self.unhidden_rays(geometry, points)
        return arriving(rays.light, rays.strata, points, rays.visible)

    def shadows(self, geometry: LightGeometry, points: Points) -> Shadows:
        """What points see of a light."""
        return Shadows(self.trace(geometry, points, self.samples_of(geometry)))

    def shines_at(self, material: int, eye: F32, position: F32) -> NDArray[np.bool_]:
        """Whether points of a material that shines are seen from a side that does.

        Args:
            material: its index. eye: places that they are seen from. (n, 3) or (1, 3) float32
            position: of the points. (n, 3) float32
        """
        if self._is_two_sided(material):
            return np.ones(len(position), np.bool_)
        return is_front(self.embree, self.positions, self.faces, eye, position)

    def trace(self, geometry: LightGeometry, points: Points, num_samples: int) -> NDArray[np.uint8]:
        """Find which samples of a light points see.

        Args:
            geometry: of the light. points: that see it. num_samples: from `samples_of`.
        Returns:
            As in `LocalRays.visible`. (n, bytes) uint8
        """
        return trace_local(self.embree, self._off_surface, *self.sampled(geometry, num_samples), points)

    def sampled(self, geometry: LightGeometry, of_rectangle: int) -> tuple[LocalLight, Strata]:
        """Make a light, and its samples. of_rectangle: see `strata_of`"""
        light = self._light(geometry)
        return light, strata_of(light, of_rectangle)

    def _light(self, geometry: LightGeometry) -> LocalLight:
        return self._memory.keep((self._key, "local light", geometry), lambda: self._make(geometry))

    def _make(self, geometry: LightGeometry) -> LocalLight:
        if geometry.kind != "mesh":
            return make_local(geometry)
        material = list(self._store.attributes["materials"]).index(geometry.material)
        chosen = self._store.read("scene/face_material") == material
        shares = np.ones(np.count_nonzero(chosen), np.float32)
        if self._store.attributes.get("has_emission_images"):
            shares = self._store.read("scene/face_emission")[chosen]
        corners = self.positions[self.faces[chosen]]
        return make_local(geometry, Triangles(corners, shares, self._is_two_sided(material)))

    def _is_two_sided(self, material: int) -> bool:
        return bool(self._store.attributes["double_sided"][material])
