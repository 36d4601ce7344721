"""Interface of an open bake for free-camera images; `relume.methods.free_camera_transfer` implements it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from jaxtyping import Shaped
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
    """One open bake of a free camera."""

    @property
    def views(self) -> Mapping[str, FreeView]: ...
    @property
    def stored_scene(self) -> StoredScene: ...
    def stored_scene_with(self, overrides: tuple[ProbeMapOverrides, ...]) -> StoredScene:
        """Return the scene with map overrides of each material."""
        ...

    @property
    def embree(self) -> EmbreeScene: ...
    @property
    def has_alpha_tested_surfaces(self) -> bool: ...
    @property
    def positions(self) -> Shaped[F32, "corners 3"]:
        """Positions of the triangles' corners, meters."""
        ...

    @property
    def occlusion_mesh(self) -> OcclusionMesh:
        """Geometry for rays between surface points."""
        ...

    @property
    def has_occluded_neighbor(self) -> Shaped[NDArray[np.uint8], " nodes"]:
        """Nodes with an occluded neighbor, from `relume.live.free_camera.occluded_probes`."""
        ...

    @property
    def vectors_shape(self) -> tuple[int, int, int]: ...
    @property
    def light_visibility_bits(self) -> Shaped[NDArray[np.uint8], "probes bytes"]:
        """Visibility of environment triangles from probes, in the order of `lobe_lights`: triangle l in bit l & 7 of
        byte l >> 3.
        """
        ...

    def lobe_lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLightLists:
        """Return lists of an environment's triangles for lobes of some widths."""
        ...

    def environment_lights(self, environment: EnvironmentKey, *, is_preview: bool) -> EnvironmentLights:
        """Return the triangles for sums over highlights. is_preview: approximate if the environment is not the baked
        one.
        """
        ...

    def prefiltered(self, name: str | None) -> EnvironmentLookup:
        """Return an environment, None for the scene's own, with levels that are blurred without bright lights."""
        ...

    def bright_lights(self, environment: EnvironmentKey) -> Shaped[F32, "lights 7"]:
        """Bright lights of an environment, rotated; see `PrefilteredEnvironment`."""
        ...

    def vectors(self, element: Illumination, without_sun_disks: bool) -> Shaped[F32, "probes 3 K"]:
        """Return the incident coefficients of all probes for one light element.

        Args:
            element: the light element. without_sun_disks: exclude direct light of sun disks.
        """
        ...

    def has_vectors(self, element: Illumination, without_sun_disks: bool) -> bool:
        """Return whether these coefficients are cached."""
        ...

    def fast_vectors(
        self, element: Illumination, probe_indices: Shaped[NDArray[np.intp], " k"], without_sun_disks: bool
    ) -> Shaped[F32, "k 3 functions"]:
        """Return approximate coefficients of some probes, possibly for fewer functions.

        Args:
            element, without_sun_disks: as in `vectors`. probe_indices: the probes.
        """
        ...

    def indirect_delta(
        self, before: Illumination, after: Illumination, probe_indices: Shaped[NDArray[np.intp], " k"]
    ) -> Shaped[F32, "k 3 functions"]:
        """Return the approximate change of indirect light at some probes.

        Args:
            before, after: lights of equal sources. probe_indices: the probes.
        """
        ...

    def hard_shadow_lights(
        self, light: Illumination, probe_indices: NDArray[np.intp] | None
    ) -> tuple[HardShadowLight, ...]:
        """Return the sun disks and small lights of a light, with unoccluded light at some probes, None for all."""
        ...

    def unoccluded(self, light: Illumination, material: int, *, is_preview: bool) -> Shaped[F32, "probes 3"]:
        """Return the outgoing radiance of white probes of a material in unoccluded light, zero at others.

        Args:
            light: its direct environment and local lights count. is_preview: approximate if the environment is not the
                baked
                one.
        """
        ...

    def environment_map(self, name: str | None, blur: float = 0) -> Shaped[F32, "height width 3"]:
        """Return the radiance of an environment, None for the scene's own, blurred by `blur` degrees."""
        ...
