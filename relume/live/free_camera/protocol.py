"""Protocol of an opened bake with a free camera; `relume.live.opened.free_camera_transfer` implements it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import EmissionImage
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck
from relume.live.fixed_camera.protocols import OpenBake
from relume.live.free_camera.environment_lookup import EnvironmentLookup
from relume.live.free_camera.free_view import FreeView
from relume.live.free_camera.hard_shadow_lights import HardShadowLight
from relume.live.free_camera.highlights.light_sum_kernel import EnvironmentLights
from relume.live.free_camera.highlights.lobe_light_lists import LobeLightLists
from relume.live.free_camera.lobe_lights import LobeLight
from relume.live.free_camera.ray_scene import OcclusionMesh
from relume.live.free_camera.texture_overrides import ProbeMapOverrides
from relume.look import EnvironmentKey, LightGeometry
from relume.look.model import Link
from relume.probes.stored_scene import StoredScene
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.interior import Obstacle, Surroundings
from relume.scene.model import Camera
from relume.transport.lobe_scene import LobeScene

F32 = NDArray[np.float32]


class FreeCameraTransfer(OpenBake, Protocol):
    """An opened bake with a free camera."""

    @property
    def views(self) -> Mapping[str, FreeView]: ...
    @property
    def stored_scene(self) -> StoredScene: ...
    def stored_scene_with(self, overrides: tuple[ProbeMapOverrides, ...]) -> StoredScene:
        """Return the stored scene with map overrides, one per material."""
        ...

    @property
    def embree(self) -> EmbreeScene: ...
    @property
    def has_alpha_tested_surfaces(self) -> bool: ...
    def emission_image(self, geometry: LightGeometry) -> EmissionImage | None:
        """Return the image that a light's surfaces emit; None if they emit as in the scene."""
        ...

    @property
    def positions(self) -> Shaped[F32, "corners 3"]:
        """Positions of triangle corners, meters."""
        ...

    @property
    def interior_camera(self) -> Camera | None:
        """A camera in the largest room; None if no place in the scene is enclosed."""
        ...

    def first_obstacle(self, path: Shaped[NDArray[np.float64], "points 3"]) -> Obstacle | None:
        """Find the first surface on a path. See `relume.raytrace.interior`."""
        ...

    def surroundings(self, position: Shaped[NDArray[np.float64], " 3"]) -> Surroundings:
        """Find the surfaces around a point. See `relume.raytrace.interior`."""
        ...

    @property
    def occlusion_mesh(self) -> OcclusionMesh:
        """Mesh for rays between surface points."""
        ...

    @property
    def has_occluded_neighbor(self) -> Shaped[NDArray[np.uint8], " nodes"]:
        """Nonzero for nodes with an occluded neighbor, from `relume.live.free_camera.occluded_probes`."""
        ...

    @property
    def num_patches(self) -> int:
        """Number of patches with indirect light."""
        ...

    @property
    def vectors_shape(self) -> tuple[int, int, int]: ...

    def check_links(self, links: Iterable[Link]) -> None:
        """Require that the scene has all objects of some links. Raises ParameterError, StoreError."""
        ...

    def light_visibility_bits(self, link: Link | None) -> Shaped[NDArray[np.uint8], "probes bytes"]:
        """Visibility of light triangles from probes, in the order of `lobe_lights`: triangle l in bit l & 7 of byte l
        >> 3.
        """
        ...

    def lobe_lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLightLists:
        """Return the light triangles of an environment, listed for lobes of some widths."""
        ...

    def environment_lights(self, environment: EnvironmentKey, *, is_preview: bool) -> EnvironmentLights:
        """Light triangles for sums over highlights. is_preview: fast, for an environment that was not baked."""
        ...

    def prefiltered(self, name: str | None) -> EnvironmentLookup:
        """Return an environment, None for the scene's own, with its prefiltered levels without bright lights."""
        ...

    def bright_lights(self, environment: EnvironmentKey) -> Shaped[F32, "lights 7"]:
        """Bright lights of a rotated environment; see `PrefilteredEnvironment`."""
        ...

    def vectors(self, element: Illumination, without_sun_disks: bool) -> Shaped[F32, "probes 3 functions"]:
        """Incident radiance coefficients of all probes for one light source and one kind of path.

        Args:
            element: the light. without_sun_disks: exclude direct light of sun disks.
        """
        ...

    def has_vectors(self, element: Illumination, without_sun_disks: bool) -> bool:
        """True if these coefficients are cached."""
        ...

    def fast_vectors(
        self, element: Illumination, probe_indices: Shaped[NDArray[np.intp], " n"], without_sun_disks: bool
    ) -> Shaped[F32, "n 3 functions"]:
        """Approximate coefficients of some probes, of fewer functions.

        Args:
            element, without_sun_disks: as in `vectors`. probe_indices: the probes.
        """
        ...

    def indirect_delta(
        self, before: Illumination, after: Illumination, probe_indices: Shaped[NDArray[np.intp], " n"]
    ) -> Shaped[F32, "n 3 functions"]:
        """Approximate change of indirect incident radiance at some probes.

        Args:
            before, after: lights with the same sources. probe_indices: the probes.
        """
        ...

    def hard_shadow_lights(
        self, light: Illumination, probe_indices: NDArray[np.intp] | None
    ) -> tuple[HardShadowLight, ...]:
        """Return sun disks and small local lights, with their unoccluded irradiance at some probes; None: at all."""
        ...

    def unoccluded(self, light: Illumination, material: int, *, is_preview: bool) -> Shaped[F32, "probes 3"]:
        """Radiance that white probes of a material would reflect if nothing occluded the light.

        Args:
            light: direct light. is_preview: fast, for an environment that was not baked.
        """
        ...

    def lobe_scene(self, light: Illumination, is_canceled: CancelCheck) -> LobeScene:
        """Return the surfaces that lobe rays meet, with their light; slow if that light is not cached.

        Args:
            light: the illumination. is_canceled: polled.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        ...

    def local_lobe_lights(self, light: Illumination) -> Sequence[LobeLight]:
        """Return the local lights as narrow lobes see them. light: the illumination"""
        ...

    def environment_map(self, name: str | None, blur: float = 0) -> Shaped[F32, "height width 3"]:
        """Radiance of an environment, None for the scene's own, blurred by `blur` degrees."""
        ...
