"""What moving pictures ask of an opened bake; `relume.methods.moving_views` implements it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relume.look import EnvironmentKey
from relume.moving.beams.beam import Beam
from relume.moving.highlights.by_lights import SkyLights
from relume.moving.highlights.lobe_lights import LobeLights
from relume.moving.points.images import Wears
from relume.moving.points.surface import Surface
from relume.moving.sky import Sky
from relume.moving.solid import Solid
from relume.moving.view import FreeView
from relume.picture.light import Light
from relume.picture.transfer import Opened
from relume.trace.embree import EmbreeScene

F32 = NDArray[np.float32]


class MovingTransfer(Opened, Protocol):
    """What it asks of an opened bake."""

    @property
    def views(self) -> Mapping[str, FreeView]: ...
    @property
    def surface(self) -> Surface: ...
    def surface_with(self, wears: tuple[Wears, ...]) -> Surface:
        """What it is where a look names images in the place of the materials' own. wears: of each material"""
        ...

    @property
    def embree(self) -> EmbreeScene: ...
    @property
    def has_holes(self) -> bool: ...
    @property
    def positions(self) -> F32:
        """Of the triangles' corners, metres. (corners, 3) float32"""
        ...

    @property
    def solid(self) -> Solid:
        """What rays between places on surfaces meet."""
        ...

    @property
    def parted(self) -> NDArray[np.uint8]:
        """Vertices that do not see all of their neighbours, from `relume.moving.parted`. (vertices,) uint8"""
        ...

    @property
    def vectors_shape(self) -> tuple[int, int, int]: ...
    @property
    def seen_lights(self) -> NDArray[np.uint8]:
        """Which light triangles points see, in the order of `lobe_lights`: triangle l in bit l & 7 of byte l >> 3.
        (points, bytes) uint8"""
        ...

    def lobe_lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLights:
        """The light triangles of an environment, as lobes of some widths look for them."""
        ...

    def sky_lights(self, environment: EnvironmentKey, *, is_preview: bool) -> SkyLights:
        """The same, as highlights are summed over them. is_preview: of another sky than the baked one, quickly."""
        ...

    def sky_in(self, name: str | None) -> Sky:
        """An environment, None for the scene's own, and what it is when it is blurred without its lamps."""
        ...

    def lamps_in(self, environment: EnvironmentKey) -> F32:
        """Lamps of an environment, turned; see `relume.moving.highlights.looking.SkyLight`. (lamps, 7) float32"""
        ...

    def vectors(self, element: Light, beside_suns: bool) -> F32:
        """Light vectors of all points in a light of one source and one kind of way. (points, 3, K) float32

        Args:
            element: that light. beside_suns: what comes straight from suns of the sky is left out.
        """
        ...

    def knows(self, element: Light, beside_suns: bool) -> bool:
        """Whether they have been made, and are there at once."""
        ...

    def preview_vectors(self, element: Light, chosen: NDArray[np.intp], beside_suns: bool) -> F32:
        """The same of some points alone, of fewer functions, found quickly. (chosen, 3, ≤ K) float32

        Args:
            element, beside_suns: as of `vectors`. chosen: the points.
        """
        ...

    def change_between(self, before: Light, after: Light, chosen: NDArray[np.intp]) -> F32:
        """How what surfaces send to some points changes, found quickly. (chosen, 3, ≤ K) float32

        Args:
            before, after: lights of equal sources. chosen: the points.
        """
        ...

    def beams(self, light: Light, chosen: NDArray[np.intp] | None) -> tuple[Beam, ...]:
        """Suns and small lamps of a light, and what they bring to some points, None for all, if nothing hides them."""
        ...

    def unhidden(self, light: Light, material: int, *, is_preview: bool) -> F32:
        """What white points of a material would send if nothing were in the light's way. (points, 3) float32

        Args:
            light: straight from the sky and from lamps. is_preview: of another sky than the baked one, quickly.
        """
        ...

    def map_of(self, name: str | None, blur: float = 0) -> F32:
        """Radiance of an environment, None for the scene's own, blurred by `blur` degrees. (height, width, 3)"""
        ...
