"""An opened bake of the method `surface`: what a moving eye sees, and what arrives there under any light."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from relume.bake import StoreReader
from relume.basis.zernike import NUM_FUNCTIONS, QUICK_DEGREE
from relume.estimated import Estimated
from relume.light.gather_rays import Pattern
from relume.light.triangles import TriangleLights
from relume.look import EnvironmentKey, LightGeometry
from relume.memory import Memory
from relume.methods.opened.bounced_views import BouncedViews
from relume.methods.opened.described import described_light
from relume.methods.skies_in_lobes import SkiesInLobes
from relume.methods.store_io import read_cells
from relume.methods.suns_of_skies import SunsOfSkies
from relume.methods.thrown import read_thrown
from relume.moving.beams.beam import Beam, lamps_of, targets_of_lamp
from relume.moving.highlights.by_lights import SkyLights
from relume.moving.highlights.lobe_lights import LobeLights
from relume.moving.parted import find_parted
from relume.moving.points.images import OWN, Wears, dressed
from relume.moving.points.surface import Surface, pattern_of_points, read_surface
from relume.moving.sky import Sky
from relume.moving.solid import Solid
from relume.moving.view import FreeView
from relume.picture.light import Light, Source
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

_PERMUTED = 4096  # points whose bits are unpacked at once


@dataclass(frozen=True)
class MovingViews:
    """Pictures from anywhere; a `relume.picture.transfer.Opened`, and what `relume.moving.picture` asks.

    Attributes:
        lit: the light of the bake, in which no view was baked.
        surface: what the eye sees.
        views: where eyes begin.
        moving_error: how far pictures are off while an eye moves, measured in the bake; None where that is not known.
    """

    lit: BouncedViews
    surface: Surface
    views: dict[str, FreeView]
    moving_error: Estimated | None = None

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
        light = described_light(store, key, memory)
        lit = BouncedViews(**light, cells=read_cells(store), thrown=read_thrown(store))
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

    def surface_with(self, wears: tuple[Wears, ...]) -> Surface:
        """What the eye sees where a look names images in the place of the materials' own.

        Args:
            wears: what it names, of each material.
        Raises:
            NotFoundError, SceneError: an image cannot be had.
        """
        if all(of == OWN for of in wears):
            return self.surface
        key = self.key, "images on surfaces", wears
        found = self.memory.keep(key, lambda: dressed(self.surface, self.positions, wears))
        return replace(self.surface, **found._asdict())

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
    def solid(self) -> Solid:
        """What rays between places on surfaces meet."""
        return Solid.of(self.surface, self.positions, self.embree)

    @cached_property
    def parted(self) -> NDArray[np.uint8]:
        """Vertices that do not see all of their neighbours, from `relume.moving.parted`. (vertices,) uint8"""
        return find_parted(self.solid)

    @cached_property
    def visible(self) -> NDArray[np.uint8]:
        """Which light triangles points see: triangle l in bit l & 7 of byte l >> 3. (points, bytes) uint8"""
        return np.asarray(self.lit.store.read("points/visibility"), np.uint8)

    @cached_property
    def _links(self) -> NDArray[np.uint16]:
        return np.asarray(self.lit.store.read("points/links"), np.uint16)

    def vectors(self, element: Light, beside_suns: bool = False) -> F32:
        """Light vectors of all points in a light: one source, one kind of way, gain 1. (points, 3, K) float32

        Args:
            element: that light. beside_suns: what comes straight from suns of the sky is left out.
        """
        key = self._key_of(element, beside_suns)
        return self.memory.keep(key, lambda: self._vectors(element, beside_suns))

    def knows(self, element: Light, beside_suns: bool = False) -> bool:
        """Whether they have been made."""
        return self.memory.holds(self._key_of(element, beside_suns))

    def _key_of(self, element: Light, beside_suns: bool) -> tuple[Hashable, ...]:
        return self.key, "light vectors", element, beside_suns and self.suns.are_in(element)

    def _vectors(self, element: Light, beside_suns: bool) -> F32:
        points = self.surface.points
        rays: list[Rays] = list(self.lit.local.all_rays(element, points, is_coarse=True))
        sent = self.lit.reflected_in(element)
        if sent is not None:
            rays.append(GatherRays(self._links, self._pattern, sent))
        lights = self.suns.lights_beside(element) if beside_suns else self.lit.lights_of(element)
        return light_vectors(points, self.visible, lights, rays)

    def preview_vectors(self, element: Light, chosen: NDArray[np.intp], beside_suns: bool = False) -> F32:
        """The same of some points, of a low degree, found quickly. (chosen, 3, functions) float32

        Args:
            element, beside_suns: as of `vectors`. chosen: the points.
        """
        points, rays = self.surface.points.rows(chosen), list[Rays]()
        if element.paths.direct:
            for source in element.local:
                seen = self.lit.local.preview(source.geometry, points).visible
                rays.append(self.lit.local.preview_rays(source, seen))
        found = ray_vectors(points, rays, QUICK_DEGREE)
        quick = self.suns.preview_lights_beside if beside_suns else self.lit.preview_lights_of
        lights = quick(element)
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

    @cached_property
    def suns(self) -> SunsOfSkies:
        """Suns of environments, and what there is beside them."""
        return SunsOfSkies(self.lit)

    def beams(self, light: Light, chosen: NDArray[np.intp] | None) -> tuple[Beam, ...]:
        """Suns and small lamps of a light, and what they bring to some points, None for all, if nothing hides them."""
        points = self.surface.points if chosen is None else self.surface.points.rows(chosen)
        found = [*self.suns.beams(light, points), *(self._beam_of(lamp, points) for lamp in lamps_of(light))]
        return tuple(found) if chosen is None else tuple(beam.spread(chosen, self.vectors_shape) for beam in found)

    def _beam_of(self, lamp: Source, points: Points) -> Beam:
        rays = self.lit.local.unhidden_rays(lamp.geometry, points)
        vectors = ray_vectors(points, [rays])
        return Beam(lamp.geometry, targets_of_lamp(lamp.geometry), vectors, np.array(lamp.gain, np.float32))

    def _quick_sky(self, lights: TriangleLights, points: Points, chosen: NDArray[np.intp]) -> F32:
        """Light vectors of an environment at some points, by harmonics where the bake has them."""
        harmonic = self.lit.harmonic
        if harmonic is None:
            return light_vectors(points, self.visible[chosen], lights, (), QUICK_DEGREE)
        divided = harmonic.divided(lights)
        seen = visible_of(self.visible, chosen, divided.chosen)
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

    @cached_property
    def _in_lobes(self) -> SkiesInLobes:
        return SkiesInLobes(self.lit)

    @cached_property
    def seen_lights(self) -> NDArray[np.uint8]:
        """Which light triangles points see, those beside each other one after another. (points, bytes) uint8"""
        order, out = self._in_lobes.order, np.empty_like(self.visible)
        for rows in np.array_split(np.arange(len(out)), len(out) // _PERMUTED + 1):
            bits = np.unpackbits(self.visible[rows], axis=1, bitorder="little")
            bits[:, : len(order)] = bits[:, order]
            out[rows] = np.packbits(bits, axis=1, bitorder="little")
        return out

    def lobe_lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLights:
        """The light triangles of an environment, as lobes of some widths look for them."""
        return self._in_lobes.lights(environment, widths)

    def sky_lights(self, environment: EnvironmentKey, *, is_preview: bool) -> SkyLights:
        """The same, as highlights are summed over them. is_preview: of another sky than the baked one, quickly."""
        return self._in_lobes.summed(environment, is_preview=is_preview)

    def lamps_in(self, environment: EnvironmentKey) -> F32:
        """Lamps of an environment, turned; see `relume.moving.highlights.looking.SkyLight`. (lamps, 7) float32"""
        return self._in_lobes.lamps(environment)

    def sky_in(self, name: str | None) -> Sky:
        """An environment, None for the scene's own, and what it is when it is blurred without its lamps."""
        return self._in_lobes.sky(name)

    def map_of(self, name: str | None, blur: float = 0) -> F32:
        """Radiance of an environment, None for the scene's own, blurred by `blur` degrees. (height, width, 3)"""
        return self.lit.map_of(name, blur)
