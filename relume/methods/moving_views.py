"""An opened bake of the method `surface`: what a moving eye sees, and what arrives there under any light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from relume.bake import StoreReader
from relume.basis.zernike import NUM_FUNCTIONS, QUICK_DEGREE
from relume.light.gather_rays import Pattern
from relume.light.triangles import TriangleLights
from relume.look import LightGeometry
from relume.memory import Memory
from relume.methods.store_io import read_cells, read_tiles, read_traced_directions
from relume.methods.transfer import BouncedViews, described_light
from relume.moving.points.surface import Surface, pattern_of_points, read_surface
from relume.moving.sky import Sky, sky_of
from relume.moving.view import FreeView
from relume.picture.light import Light
from relume.picture.transfer import Axis, Eyes
from relume.points import Points
from relume.project.alike_rays import alike_ray_vectors, weighed_functions
from relume.project.light_vectors import light_vectors, ray_vectors
from relume.project.receivers import GatherRays, Rays
from relume.project.sent import Sent
from relume.project.squares import Squares, leaving_squares
from relume.trace.embree import EmbreeScene
from relume.trace.visibility import visible_of
from relume.views.store_io import read_camera

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class MovingViews:
    """Pictures from anywhere; a `relume.picture.transfer.Opened`, and what `relume.moving.picture` asks.

    Attributes:
        lit: the light of the bake, in which no view was baked.
        surface: what the eye sees.
        views: where eyes begin.
    """

    lit: BouncedViews
    surface: Surface
    views: dict[str, FreeView]

    eyes = Eyes.FREE
    axes = BouncedViews.axes | {Axis.EYE}

    @classmethod
    def of(cls, store: StoreReader, key: str, memory: Memory) -> Self:
        """Open a store.

        Args:
            store: an open one. key: of the bake in the memory. memory: of all that is made from the bake.
        Raises:
            StoreError: its description is not of this form. ChunkDamagedError: its arrays do not fit each other.
        """
        lit = BouncedViews(**described_light(store, key, memory), cells=read_cells(store))
        width, height = store.attributes["size"]
        cameras = (read_camera(store, k) for k in range(len(store.attributes["views"])))
        surface = read_surface(store)
        place = surface.points.position
        bounds = place.min(axis=0).astype(np.float64), place.max(axis=0).astype(np.float64)
        return cls(lit, surface, {camera.name: FreeView(camera, width, height, bounds) for camera in cameras})

    @property
    def memory(self) -> Memory:
        """Of all that is made from the bake and may be made again."""
        return self.lit.memory

    @property
    def key(self) -> str:
        """Path of the store."""
        return self.lit.key

    @property
    def scene_id(self) -> str:
        """Of the scene that was baked."""
        return self.lit.scene_id

    @property
    def method(self) -> str:
        """That it was baked by."""
        return self.lit.method

    @property
    def default_look(self) -> dict[str, Any]:
        """The complete look of the scene as it was imported."""
        return self.lit.default_look

    @property
    def material_names(self) -> Sequence[str]:
        """In the scene's order."""
        return self.lit.material_names

    def radiance_of(self, name: str | None) -> F32:
        """Radiance of an environment, None for the scene's own. (height, width, 3) float32"""
        return self.lit.radiance_of(name)

    @property
    def has_holes(self) -> bool:
        """Whether rays may pass some triangles."""
        return self.lit.local.has_holes

    @property
    def embree(self) -> EmbreeScene:
        """The triangles' search tree."""
        return self.lit.local.embree

    @property
    def positions(self) -> F32:
        """Of the triangles' corners, metres. (corners, 3) float32"""
        return self.lit.local.positions

    @cached_property
    def _visible(self) -> NDArray[np.uint8]:
        return np.asarray(self.lit.store.read("points/visibility"), np.uint8)

    @cached_property
    def _links(self) -> NDArray[np.uint16]:
        return np.asarray(self.lit.store.read("points/links"), np.uint16)

    def vectors(self, element: Light) -> F32:
        """Light vectors of all points in a light: one source, one kind of way, gain 1. (points, 3, K) float32"""
        return self.memory.keep(self._key_of(element), lambda: self._vectors(element))

    def knows(self, element: Light) -> bool:
        """Whether they have been made."""
        return self.memory.holds(self._key_of(element))

    def _key_of(self, element: Light) -> tuple[str, str, Light]:
        return self.key, "light vectors", element

    def _vectors(self, element: Light) -> F32:
        points = self.surface.points
        rays: list[Rays] = list(self.lit.local.all_rays(element, points))
        sent = self.lit.reflected_in(element)
        if sent is not None:
            rays.append(GatherRays(self._links, self._pattern, sent))
        return light_vectors(points, self._visible, self.lit.lights_of(element), rays)

    def preview_vectors(self, element: Light, chosen: NDArray[np.intp]) -> F32:
        """The same of some points, of a low degree, found quickly. (chosen, 3, functions) float32"""
        points, rays = self.surface.points.rows(chosen), list[Rays]()
        if element.paths.direct:
            for source in element.local:
                seen = self.lit.local.preview(source.geometry, points).visible
                rays.append(self.lit.local.preview_rays(source, seen))
        found = ray_vectors(points, rays, QUICK_DEGREE)
        lights = self.lit.preview_lights_of(element)
        if lights.num_lights:
            found += self._quick_sky(lights, points, chosen)
        if element.paths.reflect:
            found += self._of_rays(self.lit.reflected.quickly_under(element), chosen)
        return found

    def change_between(self, before: Light, after: Light, chosen: NDArray[np.intp]) -> F32:
        """How what surfaces send to some points changes, of a low degree, found quickly. (chosen, 3, functions) float32

        Args:
            before, after: lights of equal sources. chosen: the points.
        """
        return self._of_rays(self.lit.reflected.change(before, after), chosen)

    def _of_rays(self, sent: Sent, chosen: NDArray[np.intp]) -> F32:
        return alike_ray_vectors(self._links, self._squares, chosen, self._functions_of_rays, sent)

    @property
    def _squares(self) -> Squares:
        def found() -> Squares:
            return leaving_squares(self.surface.points, self._links, self._pattern, self.lit.cells.frames)

        return self.memory.keep((self.key, "squares of links"), found)

    def _quick_sky(self, lights: TriangleLights, points: Points, chosen: NDArray[np.intp]) -> F32:
        """Light vectors of an environment at some points, by harmonics where the bake has them."""
        harmonic = self.lit.harmonic
        if harmonic is None:
            return light_vectors(points, self._visible[chosen], lights, (), QUICK_DEGREE)
        divided = harmonic.divided(lights)
        seen = visible_of(self._visible, chosen, divided.chosen)
        beyond = light_vectors(points, seen, divided.beyond, (), QUICK_DEGREE)
        return beyond + harmonic.of_points.vectors(divided.smooth, chosen)

    @cached_property
    def _functions_of_rays(self) -> F32:
        return weighed_functions(self._pattern, 0, QUICK_DEGREE)  # all points have one seed

    def unhidden(self, light: Light, material: int, *, is_preview: bool) -> F32:
        """What white points of a material would send if nothing were in the light's way; of others nothing.

        Args:
            light: straight from the sky and from lamps, not from surfaces that shine, which are not there.
            material: whose points. is_preview: of another sky than the baked one, quickly.
        Returns:
            (points, 3) float32
        """
        rows, kept = np.flatnonzero(self.surface.material == material), self.memory.passing
        key = self.key, "unhidden light", material

        def sky() -> F32:
            return self._open_sky(light, self.surface.points.rows(rows), is_preview=is_preview)

        def of(lamp: LightGeometry) -> F32:
            return self.lit.local.unhidden(lamp, self.surface.points.rows(rows))

        found = kept.keep((*key, light.environment, is_preview), sky) * np.array(light.environment_gain, np.float32)
        for lamp, gain in light.local:
            if lamp.kind != "mesh":
                one = kept.keep((*key, lamp), lambda lamp=lamp: of(lamp))  # type: ignore[misc]
                found += np.outer(one, np.array(gain, np.float32) / np.float32(np.pi))
        out = np.zeros((self.surface.points.num_points, 3), np.float32)
        out[rows] = found
        return out

    def _open_sky(self, light: Light, points: Points, *, is_preview: bool) -> F32:
        """What white points send under the whole sky, of which there are few that differ. (n, 3) float32"""
        _, first, of_normal = np.unique(points.normal, axis=0, return_index=True, return_inverse=True)
        lights, receivers = self.lit.open_sky(light, points.rows(first), is_preview=is_preview)
        # the first function is constant, and its light vector the irradiance
        constant = light_vectors(receivers.points, receivers.visible, lights, (), 0)[:, :, 0]
        return np.asarray(constant[of_normal.ravel()] / np.float32(np.sqrt(np.pi)), np.float32)

    @cached_property
    def _pattern(self) -> Pattern:
        return pattern_of_points(self.lit.store, self._links.shape[1])

    @property
    def vectors_shape(self) -> tuple[int, int, int]:
        """Of light vectors: points, channels, K."""
        return self.surface.points.num_points, 3, NUM_FUNCTIONS

    @property
    def sky_share(self) -> F32:
        """What each point sees of the sky, in the in-basis, of whatever brightness it is. (points, K) float32"""
        return self.memory.keep((self.key, "share of the sky"), self._sky_share)

    def _sky_share(self) -> F32:
        lights = self.lit.lights
        areas = np.repeat(read_tiles(self.lit.store).solid_angles[:, None], 3, axis=1).astype(np.float32)
        directions = read_traced_directions(self.lit.store)
        white = TriangleLights(lights.nodes, directions, areas)
        return np.ascontiguousarray(light_vectors(self.surface.points, self._visible, white, ())[:, 0])

    def sky_in(self, name: str | None) -> Sky:
        """An environment, None for the scene's own, and what it is when it is blurred."""
        owner = self.key if name is None else "environments"
        return self.memory.keep((owner, "sky", name), lambda: sky_of(lambda degrees: self.map_of(name, degrees)))

    def map_of(self, name: str | None, blur: float = 0) -> F32:
        """Radiance of an environment, None for the scene's own, blurred by `blur` degrees. (height, width, 3)"""
        return self.lit.map_of(name, blur)
