"""What moving pictures ask of an opened bake; `relume.methods.free_camera_transfer` implements it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.protocols import OpenBake
from relume.live.free_camera.environment_lookup import EnvironmentLookup
from relume.live.free_camera.free_view import FreeView
from relume.live.free_camera.hard_shadows.lights import HardShadowLight
from relume.live.free_camera.highlights.light_sum_kernel import EnvironmentLights
from relume.live.free_camera.highlights.lobe_light_lists import LobeLightLists
from relume.live.free_camera.probes.stored_scene import StoredScene
from relume.live.free_camera.probes.texture_overrides import ProbeMapOverrides
from relume.live.free_camera.ray_scene import OcclusionMesh
from relume.look import EnvironmentKey
from relume.raytrace.embree import EmbreeScene

F32 = NDArray[np.float32]


class FreeCameraTransfer(OpenBake, Protocol):
    """What it asks of an opened bake."""

    @property
    def views(self) -> Mapping[str, FreeView]: ...
    @property
    def stored_scene(self) -> StoredScene: ...
    def stored_scene_with(self, overrides: tuple[ProbeMapOverrides, ...]) -> StoredScene:
        """What it is where a look names images in the place of the materials' own. wears: of each material"""
        ...

    @property
    def embree(self) -> EmbreeScene: ...
    @property
    def has_alpha_tested_surfaces(self) -> bool: ...
    @property
    def positions(self) -> F32:
        """Of the triangles' corners, metres. (corners, 3) float32"""
        ...

    @property
    def occlusion_mesh(self) -> OcclusionMesh:
        """What rays between places on surfaces meet."""
        ...

    @property
    def has_occluded_neighbor(self) -> NDArray[np.uint8]:
        """Nodes with an occluded neighbor, from `relume.live.free_camera.occluded_probes`. (nodes,) uint8"""
        ...

    @property
    def vectors_shape(self) -> tuple[int, int, int]: ...
    @property
    def light_visibility_bits(self) -> NDArray[np.uint8]:
        """Which light triangles points see, in the order of `lobe_lights`: triangle l in bit l & 7 of byte l >> 3.
        (points, bytes) uint8"""
        ...

    def lobe_lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLightLists:
        """The light triangles of an environment, as lobes of some widths look for them."""
        ...

    def environment_lights(self, environment: EnvironmentKey, *, is_preview: bool) -> EnvironmentLights:
        """The same, as highlights are summed over them. is_preview: of another sky than the baked one, quickly."""
        ...

    def prefiltered(self, name: str | None) -> EnvironmentLookup:
        """An environment, None for the scene's own, and what it is when it is blurred without its lamps."""
        ...

    def bright_lights(self, environment: EnvironmentKey) -> F32:
        """Bright lights of an environment, turned; see `PrefilteredEnvironment`. (lights, 7) float32"""
        ...

    def vectors(self, element: Illumination, without_sun_disks: bool) -> F32:
        """Light vectors of all points in a light of one source and one kind of way. (points, 3, K) float32

        Args:
            element: that light. without_sun_disks: what comes straight from suns of the sky is left out.
        """
        ...

    def has_vectors(self, element: Illumination, without_sun_disks: bool) -> bool:
        """Whether they have been made, and are there at once."""
        ...

    def fast_vectors(self, element: Illumination, probe_indices: NDArray[np.intp], without_sun_disks: bool) -> F32:
        """The same of some points alone, of fewer functions, found quickly. (chosen, 3, ≤ K) float32

        Args:
            element, without_sun_disks: as of `vectors`. probe_indices: the points.
        """
        ...

    def indirect_delta(self, before: Illumination, after: Illumination, probe_indices: NDArray[np.intp]) -> F32:
        """How what surfaces send to some points changes, found quickly. (chosen, 3, ≤ K) float32

        Args:
            before, after: lights of equal sources. probe_indices: the points.
        """
        ...

    def hard_shadow_lights(
        self, light: Illumination, probe_indices: NDArray[np.intp] | None
    ) -> tuple[HardShadowLight, ...]:
        """Suns and small lamps of a light, and what they bring to some points, None for all, if nothing hides them."""
        ...

    def unoccluded(self, light: Illumination, material: int, *, is_preview: bool) -> F32:
        """What white points of a material would send if nothing were in the light's way. (points, 3) float32

        Args:
            light: straight from the sky and from lamps. is_preview: of another sky than the baked one, quickly.
        """
        ...

    def environment_map(self, name: str | None, blur: float = 0) -> F32:
        """Radiance of an environment, None for the scene's own, blurred by `blur` degrees. (height, width, 3)"""
        ...
