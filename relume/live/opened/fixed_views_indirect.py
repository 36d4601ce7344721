"""Bakes of fixed views with direct and indirect illumination, opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import Illumination, Normals
from relume.live.fixed_camera.protocols import EditAxis
from relume.live.opened.fixed_views import BakedFixedViews, IntegrateEnvironment, SampledTransfer, read_fields
from relume.live.opened.harmonic_light import HarmonicLight, read_harmonic_light
from relume.live.opened.indirect_solver import IndirectSolver
from relume.live.opened.local_lights import LocalLights
from relume.live.opened.patch_direct_light import DirectPatchLight
from relume.live.opened.planar_mirror_light import AddedMirrorLights, MirrorLightTransfer
from relume.live.opened.retrace import NormalRetracer
from relume.live.opened.stored_patches import read_patches
from relume.methods.mirror_lights import MirrorLights, read_mirror_lights
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.normal_mapped_patches import normal_mapped_patches
from relume.radiosity.patch_irradiance import PatchLight
from relume.store.bake_protocol import StoreReader
from relume.transport.outgoing_patch_light import isotropic
from relume.transport.shading_points import GatherRays, RayList
from relume.views.view import View

_NO_LIGHT = isotropic(np.zeros((NO_PATCH + 1, 3), np.float32))


@dataclass(frozen=True)
class BakedIndirectViews(BakedFixedViews):
    """A bake of fixed views with direct and indirect illumination.

    Attributes:
        patches: surface patches with indirect light.
        mirror_lights: virtual lights of planar mirrors; None if there are none.
    """

    patches: PatchLight
    mirror_lights: MirrorLights | None

    axes = BakedFixedViews.axes | {EditAxis.BOUNCES}

    @classmethod
    def from_store(cls, store: StoreReader, key: str, cache: Cache) -> Self:
        """Open a store with patches. See `BakedFixedViews`."""
        fields = read_fields(store, key, cache)
        return cls(**fields, patches=read_patches(store), mirror_lights=read_mirror_lights(store))

    @cached_property
    def indirect(self) -> IndirectSolver:
        """Solver for the outgoing light of the patches."""
        direct_light = DirectPatchLight(self.patches, *self._direct_light_args, self.harmonic)
        return IndirectSolver(direct_light, self._normal_mapped_direct_light, self.cache, self.key)

    def _normal_mapped_direct_light(self, normals: Normals) -> DirectPatchLight:
        """Return the direct light of patches with normal-map overrides: one image per material, None for none."""
        return DirectPatchLight(
            self._normal_mapped_patches(normals), *self._direct_light_args, normal_overrides=(normals,)
        )

    def _normal_mapped_patches(self, normals: Normals, is_canceled: Callable[[], bool] = lambda: False) -> PatchLight:
        key = self.key, "patches with mapped normals", normals
        return self.cache.get_value(key, lambda: normal_mapped_patches(self.patches, normals, self.tracer, is_canceled))

    def solve_indirect_cache(self, light: Illumination, is_canceled: Callable[[], bool]) -> None:
        """Trace missing rays of patches with overridden normals. See `FixedViewTransfer`."""
        if any(normals := light.normals):
            self._normal_mapped_patches(normals, is_canceled)

    @property
    def _direct_light_args(self) -> tuple[LocalLights, IntegrateEnvironment, IntegrateEnvironment, Cache, str]:
        """Arguments of `DirectPatchLight`."""
        return self.local, self.light_of_environment, self.preview_light_of_environment, self.cache, self.key

    @cached_property
    def mirror_light(self) -> MirrorLightTransfer | None:
        """Light of planar mirrors in any look."""
        if self.mirror_lights is None:
            return None
        return MirrorLightTransfer(self.mirror_lights, self.patches, self.light_of_environment, self.cache, self.key)

    @cached_property
    def tracer(self) -> NormalRetracer:
        """Tracer for normals that were not baked."""
        return NormalRetracer(self.store, self.local, self.mirror_lights)

    @cached_property
    def harmonic(self) -> HarmonicLight | None:
        """Spherical-harmonic transfer to probes and patches, if baked."""
        return read_harmonic_light(self.store, self.patches)

    def _rays(self, view: View, material: int, light: Illumination, cache: Cache) -> Sequence[RayList]:
        """Return the rays of incident light: from patches and local lights."""
        local = super()._rays(view, material, light, cache)
        if not light.paths.has_indirect:
            return local
        rays, mirror_visibility = view.gather_rays(material, _NO_LIGHT), self.mirror_lights_of(view, material)
        return (*self.indirect_rays(light, rays, mirror_visibility), *local)

    def indirect_rays(
        self,
        light: Illumination,
        gather_rays: GatherRays,
        mirror_visibility: Shaped[NDArray[np.uint8], "n bytes"] | None,
    ) -> tuple[RayList, ...]:
        """Return the rays that carry indirect illumination to samples. See `BakedFixedViews`."""
        mirror_light = self.mirror_light
        if mirror_visibility is None or mirror_light is None or not mirror_light.is_in(light):
            return super().indirect_rays(light, gather_rays, mirror_visibility)
        outgoing = self.indirect.excluding(light, mirror_light.patch_part)
        return replace(gather_rays, outgoing=outgoing), mirror_light.rays(light, mirror_visibility)

    def mirror_lights_of(self, view: View, material: int) -> Shaped[NDArray[np.uint8], "n bytes"] | None:
        """Return the lights that a material's samples see in planar mirrors."""
        if self.mirror_lights is None:
            return None
        rows = view.rows(material)

        def read() -> NDArray[np.uint8]:
            return view.store.read(f"views/{view.index}/mirror_lights", rows.start, rows.stop)

        return self.cache.transient.get_value((self.key, "mirror lights", *view.sample_key(material)), read)

    def mirror_lights_delta(self, before: Illumination, after: Illumination) -> AddedMirrorLights | None:
        """Return the change of light from planar mirrors. See `FixedViewTransfer`."""
        return None if self.mirror_light is None else self.mirror_light.delta(before, after)

    def subset(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " m"], *, has_indirect: bool
    ) -> SampledTransfer:
        """Select samples of a material. See `FixedViewTransfer`."""
        samples = super().subset(view, material, sample_indices, has_indirect=has_indirect)
        if not has_indirect:
            return samples
        mirror_visibility = (
            None
            if self.mirror_lights is None
            else np.asarray(view.read_rows("mirror_lights", material, sample_indices), np.uint8)
        )
        return replace(
            samples,
            gather_rays=view.subset_rays(material, sample_indices, _NO_LIGHT),
            mirror_visibility=mirror_visibility,
        )
