"""Bakes of fixed views with direct and indirect illumination, opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectances
from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import Illumination, Normals, with_baked_normals
from relume.live.fixed_camera.protocols import EditAxis, LightQuality, Samples
from relume.live.opened.fixed_views import BakedFixedViews, FindLights, read_fields
from relume.live.opened.harmonic_light import HarmonicLight, read_harmonic_light
from relume.live.opened.indirect_solver import IndirectSolver
from relume.live.opened.lobe_light import LobePatches, broad_share
from relume.live.opened.local_lights import LocalLights
from relume.live.opened.object_material_store import ObjectMaterialStore
from relume.live.opened.patch_direct_light import DirectPatchLight
from relume.live.opened.planar_mirror_light import MirrorLightTransfer
from relume.live.opened.retrace import NormalRetracer
from relume.live.opened.samples import SelectedSamples
from relume.live.opened.stored_patches import read_patches
from relume.look.object_materials import ObjectMaterials
from relume.methods.mirror_lights import MirrorLights, read_mirror_lights
from relume.radiosity.normal_mapped_patches import normal_mapped_patches
from relume.radiosity.patch_irradiance import PatchLight
from relume.store.bake_protocol import StoreReader
from relume.transport.outgoing_patch_light import OutgoingLight, no_light
from relume.transport.shading_points import GatherRays, RayList
from relume.views.view import View

F32 = NDArray[np.float32]

_LEAST_REFLECTANCE = np.float32(1e-12)  # of a black patch


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

    def _assign(self, store: ObjectMaterialStore, key: str, materials: ObjectMaterials) -> Self:
        return replace(super()._assign(store, key, materials), patches=read_patches(store))

    @cached_property
    def indirect(self) -> IndirectSolver:
        """Solver for the light of patches at samples, which see virtual lights in planar mirrors as well."""
        return self._solver(self.mirror_light)

    @cached_property
    def indirect_at_probes(self) -> IndirectSolver:
        """Solver for the light of patches at probes, which store no visibility of virtual lights."""
        return self._solver(None)

    def _solver(self, mirror_light: MirrorLightTransfer | None) -> IndirectSolver:
        direct_light = DirectPatchLight(self.patches, *self._direct_light_args, self.harmonic)
        return IndirectSolver(direct_light, self._normal_mapped_direct_light, mirror_light, self.cache, self.key)

    def _normal_mapped_direct_light(self, normals: Normals, is_canceled: Callable[[], bool]) -> DirectPatchLight:
        """Return the direct light of patches with normal-map overrides: one image per material, None for none."""
        key = self.key, "patches with mapped normals", normals
        patches = self.cache.get_value(
            key, lambda: normal_mapped_patches(self.patches, normals, self.tracer, is_canceled)
        )
        return DirectPatchLight(patches, *self._direct_light_args, normal_overrides=(normals,))

    @property
    def _direct_light_args(self) -> tuple[LocalLights, FindLights, Cache, str]:
        """Arguments of `DirectPatchLight`."""
        return self.local, self.environment_lights, self.cache, self.key

    @cached_property
    def mirror_light(self) -> MirrorLightTransfer | None:
        """Light of planar mirrors in any look."""
        if self.mirror_lights is None:
            return None
        return MirrorLightTransfer(self.mirror_lights, self.patches, *self._direct_light_args)

    @cached_property
    def tracer(self) -> NormalRetracer:
        """Tracer for normals that were not baked."""
        return NormalRetracer(self.store, self.local, self.mirror_lights)

    @cached_property
    def harmonic(self) -> HarmonicLight | None:
        """Spherical-harmonic transfer to probes and patches, if baked."""
        return read_harmonic_light(self.store, self.patches)

    def selected_samples(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " m"], *, has_indirect: bool
    ) -> SelectedSamples:
        """Select samples of a material. See `FixedViewTransfer`."""
        samples = super().selected_samples(view, material, sample_indices, has_indirect=has_indirect)
        if not has_indirect:
            return samples
        mirror_visibility = (
            None
            if self.mirror_lights is None
            else np.asarray(view.read_rows("mirror_lights", material, sample_indices), np.uint8)
        )
        gather_rays = view.subset_rays(material, sample_indices)
        return replace(samples, stored_rays=gather_rays, mirror_visibility=mirror_visibility)

    def patch_light(
        self, light: Illumination, is_canceled: Callable[[], bool], quality: LightQuality = LightQuality.EXACT
    ) -> OutgoingLight:
        """Return the outgoing light of patches.

        Args:
            light: the illumination. is_canceled: polled. quality: of the light.
        """
        return self.indirect.outgoing_light(light, quality, is_canceled) if light.paths.has_indirect else no_light()

    def _lobe_patches(self, reflectances: Reflectances) -> LobePatches:
        """Return the textures and reflectances of patches, for lobe rays."""
        out, material, num = super()._lobe_patches(reflectances), self.patches.material, self.patches.num_patches
        if reflectances:
            of_material = np.stack([reflectance.matrix[:, :, 0] for reflectance in reflectances], axis=1)[:, material]
            out.mean[:, :num] = self.patches.texture_multipliers(reflectances)
            total = of_material[0] + (out.mean[:, :num] * of_material[1:]).sum(axis=0)
            out.unit_share[:, :num] = of_material[1:] / np.maximum(total, _LEAST_REFLECTANCE)
            broad = np.array([broad_share(reflectance) for reflectance in reflectances], np.float32)
            out.broad_share[:num] = broad[material]
        return out

    def _patch_visibility(self, lights: Shaped[NDArray[np.intp], " K"]) -> Shaped[F32, "patches K"]:
        """Return the fraction of each patch's points that see some light triangles."""
        out, bits = super()._patch_visibility(lights), self.patches.visible[:, :, lights >> 3] >> (lights & 7) & 1
        out[: len(bits)] = bits.mean(axis=1)
        return out

    def _gather_rays(
        self, samples: Samples, light: Illumination, quality: LightQuality, is_canceled: Callable[[], bool]
    ) -> tuple[GatherRays, ...]:
        """Return the rays from patches."""
        gather_rays = samples.gather_rays(is_canceled)
        if gather_rays is None:
            return ()
        # in a preview, tracing overridden normals takes too long
        reflected = with_baked_normals(light) if quality is LightQuality.PREVIEW else light
        return (replace(gather_rays, outgoing=self.indirect.outgoing_light(reflected, quality, is_canceled)),)

    def _mirror_rays(self, samples: Samples, light: Illumination, followed: Collection[int]) -> tuple[RayList, ...]:
        """Return the rays from virtual lights in planar mirrors, but not in those that lobe rays follow."""
        mirror_light = self.mirror_light
        if mirror_light is None or not light.paths.has_indirect or not mirror_light.is_in(light):
            return ()
        visible = samples.mirror_visibility
        if visible is None:
            return ()
        virtual_lights = mirror_light.virtual_lights(light).beside(mirror_light.of_materials(followed))
        return (virtual_lights.rays(visible),)
