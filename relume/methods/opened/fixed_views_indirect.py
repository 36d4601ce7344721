"""Bakes of fixed views in which light comes from other surfaces, too, opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import Illumination, Normals
from relume.live.fixed_camera.protocols import EditAxis
from relume.methods.indirect_solver import IndirectSolver
from relume.methods.local_lights import LocalLights
from relume.methods.opened.fixed_views import BakedFixedViews, LightFinder, SampledTransfer
from relume.methods.patch_direct_light import DirectPatchLight
from relume.methods.planar_mirror_light import AddedMirrorLights, MirrorLights, MirrorLightTransfer
from relume.methods.retrace import NormalRetracer
from relume.methods.spherical_harmonic_transfer import HarmonicLight, read_harmonic_light
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.normal_mapped_patches import normal_mapped_patches
from relume.radiosity.patch_irradiance import PatchLight
from relume.transport.outgoing_patch_light import isotropic
from relume.transport.shading_points import GatherRays, RayList
from relume.views.view import View

_NO_LIGHT = isotropic(np.zeros((NO_PATCH + 1, 3), np.float32))


@dataclass(frozen=True)
class BakedIndirectViews(BakedFixedViews):
    """A bake of fixed views in which light comes from other surfaces, too.

    Attributes:
        patches: gather cells, which send it.
        mirror_lights: what flat mirrors send exactly; None where there are none.
    """

    patches: PatchLight
    mirror_lights: MirrorLights | None

    axes = BakedFixedViews.axes | {EditAxis.BOUNCES}

    @cached_property
    def indirect(self) -> IndirectSolver:
        """Light that gather cells send out."""
        direct_light = DirectPatchLight(self.patches, *self._direct_light_args, self.harmonic)
        return IndirectSolver(direct_light, self._normal_mapped_direct_light, self.cache, self.key)

    def _normal_mapped_direct_light(self, normals: Normals) -> DirectPatchLight:
        """The light on cells of which some lean as images say. normals: the image of each material, None for none"""
        return DirectPatchLight(
            self._normal_mapped_patches(normals), *self._direct_light_args, normal_overrides=(normals,)
        )

    def _normal_mapped_patches(self, normals: Normals, is_canceled: Callable[[], bool] = lambda: False) -> PatchLight:
        key = self.key, "patches with mapped normals", normals
        return self.cache.get_value(key, lambda: normal_mapped_patches(self.patches, normals, self.tracer, is_canceled))

    def solve_indirect_cache(self, light: Illumination, is_canceled: Callable[[], bool]) -> None:
        """Trace what cells lack that lean otherwise than they were baked. See `FixedViewTransfer`."""
        if any(normals := light.normals):
            self._normal_mapped_patches(normals, is_canceled)

    @property
    def _direct_light_args(self) -> tuple[LocalLights, LightFinder, LightFinder, Cache, str]:
        """What light comes to cells, and where it is kept."""
        return self.local, self.light_of_environment, self.preview_light_of_environment, self.cache, self.key

    @cached_property
    def mirror_light(self) -> MirrorLightTransfer | None:
        """The same in any look."""
        if self.mirror_lights is None:
            return None
        return MirrorLightTransfer(self.mirror_lights, self.patches, self.light_of_environment, self.cache, self.key)

    @cached_property
    def tracer(self) -> NormalRetracer:
        """Rays for normals that the bake did not know."""
        return NormalRetracer(self.store, self.local, self.mirror_lights)

    @cached_property
    def harmonic(self) -> HarmonicLight | None:
        """How smooth light comes to points and cells, where that was baked."""
        return read_harmonic_light(self.store, self.patches)

    def _rays(self, view: View, material: int, light: Illumination, cache: Cache) -> Sequence[RayList]:
        """The rays among what arrives: those of gather cells, and of local lights."""
        local = super()._rays(view, material, light, cache)
        if not light.paths.has_indirect:
            return local
        rays, mirror_visibility = view.gather_rays(material, _NO_LIGHT), self.mirror_lights_of(view, material)
        return (*self.indirect_rays(light, rays, mirror_visibility), *local)

    def indirect_rays(
        self, light: Illumination, gather_rays: GatherRays, mirror_visibility: NDArray[np.uint8] | None
    ) -> tuple[RayList, ...]:
        """The rays of samples that bring what surfaces send. See `BakedFixedViews`."""
        mirror_light = self.mirror_light
        if mirror_visibility is None or mirror_light is None or not mirror_light.is_in(light):
            return super().indirect_rays(light, gather_rays, mirror_visibility)
        outgoing = self.indirect.excluding(light, mirror_light.patch_part)
        return replace(gather_rays, outgoing=outgoing), mirror_light.rays(light, mirror_visibility)

    def mirror_lights_of(self, view: View, material: int) -> NDArray[np.uint8] | None:
        """The lights that a material's samples see in flat mirrors. (n, bytes) uint8"""
        if self.mirror_lights is None:
            return None
        rows = view.rows(material)

        def read() -> NDArray[np.uint8]:
            return view.store.read(f"views/{view.index}/mirror_lights", rows.start, rows.stop)

        return self.cache.transient.get_value((self.key, "mirror lights", *view.sample_key(material)), read)

    def mirror_lights_delta(self, before: Illumination, after: Illumination) -> AddedMirrorLights | None:
        """How much more flat mirrors throw after than before. See `FixedViewTransfer`."""
        return None if self.mirror_light is None else self.mirror_light.delta(before, after)

    def subset(
        self, view: View, material: int, sample_indices: NDArray[np.integer], *, has_indirect: bool
    ) -> SampledTransfer:
        """Some of a material's samples. See `FixedViewTransfer`."""
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
