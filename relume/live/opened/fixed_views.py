"""Bakes of fixed views, opened for freezing and frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self
from weakref import WeakValueDictionary

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment_names import load_environment
from relume.assets.environments.equirect import halve_to_width, lookup, rotate_about_y
from relume.brdf.albedo import Reflectances
from relume.brdf.lobe_sampling import LobeSampling
from relume.camera.glass_passages import GlassPassages, trace_passages
from relume.core.cache import Cache
from relume.core.digest import digest
from relume.core.errors import ParameterError, StoreError
from relume.core.source_hash import image_code
from relume.lights.light_clusters import cluster_lights, num_clusters
from relume.lights.prefilter import downsampled, prefiltered
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import EnvironmentTexels, TriangleLights, integrate_environment
from relume.live.fixed_camera.illumination import (
    Illumination,
    emission_images,
    images_by_material,
    material_emissions,
)
from relume.live.fixed_camera.protocols import CameraMode, EditAxis, LightQuality, LightsAndPoints, Samples
from relume.live.free_camera.lobe_lights import LobeLight
from relume.live.opened.few_lobe_rays import FewLobeRays
from relume.live.opened.indirect_solver import IndirectSolver
from relume.live.opened.linked_surfaces import LightLinks
from relume.live.opened.lobe_light import (
    HitImages,
    LobePatches,
    LobeTracer,
    bright_triangles,
    choose_peaks,
    hit_images,
    lobe_environment,
    narrow_surfaces,
    no_lobe_patches,
    only_broad,
    reflects_narrowly,
    tile_of_texels,
    trace_lobes,
)
from relume.live.opened.local_lights import LocalLights
from relume.live.opened.object_material_store import ObjectMaterialStore
from relume.live.opened.own_images import OwnImages
from relume.live.opened.refined_environments import RefinedEnvironments
from relume.live.opened.retrace import NormalRetracer
from relume.live.opened.samples import MaterialSamples, SelectedSamples
from relume.live.opened.split_samples import split_light
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey, Look, complete, validate
from relume.look.glass import GlassOfLook, glass_of
from relume.look.object_materials import ObjectMaterials
from relume.methods.store_layout import read_lights, read_shadow_ray_directions, read_tiles
from relume.operators.image_cache import ImageFiles
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import above_horizon, select_visibility
from relume.store.bake_protocol import StoreReader
from relume.transport.lobe_rays import NO_ENVIRONMENT, NO_PEAKS, LobeEnvironment, LobePeaks, LobeRays
from relume.transport.lobe_scene import LobeScene
from relume.transport.outgoing_patch_light import OutgoingLight, no_light
from relume.transport.shading_points import GatherRays, RayList, ShadingPoints
from relume.transport.split_light import SplitLight
from relume.views.downsampled import DownsampledStore
from relume.views.frost_filter import GLOW_WIDTH, MAX_FROSTED_RATIO, RAY_SPACING
from relume.views.split_pixels import with_normals
from relume.views.view import View, open_view

PREVIEW_WIDTH = 256
_EDITED_BYTES = 256 << 20

F32 = NDArray[np.float32]
FindLights = Callable[[EnvironmentKey, LightQuality], TriangleLights]
"""Returns the triangles of an environment."""


@dataclass(frozen=True)
class BakedFixedViews:
    """One bake of fixed views with direct illumination; a `relume.live.fixed_camera.protocols.FixedViewTransfer`.

    Attributes:
        cache: cache of results computed from the bake.
        key: path of the store; identifies this bake's entries in the cache.
        default_look: the complete look of the scene as it was imported.
        glass: the glass that rays have met: that of `default_look`, or edited glass.
        object_materials: materials of objects that a look has added to those of the scene.
        scene_bake: the bake without object materials; None for itself.
    """

    cache: Cache
    key: str
    store: StoreReader
    scene_id: str
    method: str
    num_lights: int
    default_look: dict[str, Any]
    glass: GlassOfLook
    material_names: Sequence[str]
    views: dict[str, View]
    object_materials: ObjectMaterials = field(default=(), kw_only=True)
    scene_bake: Self | None = field(default=None, repr=False, compare=False, kw_only=True)

    camera_mode = CameraMode.FIXED
    axes = frozenset((EditAxis.CURVE, EditAxis.PARAMETER, EditAxis.LIGHT, EditAxis.ENVIRONMENT))

    @classmethod
    def from_store(cls, store: StoreReader, key: str, cache: Cache) -> Self:
        """Open a store: an `Opener`.

        Args:
            store: an open store. key: of the bake in the cache. cache: of results computed from the bake.
        Raises:
            StoreError: its description is invalid. ChunkDamagedError: its arrays do not match.
        """
        return cls(**read_fields(store, key, cache))

    def with_object_materials(self, materials: ObjectMaterials) -> Self:
        """Return the same bake with object materials of a look. See `FixedViewTransfer`."""
        if materials == self.object_materials:
            return self
        if self.scene_bake is not None:
            return self.scene_bake.with_object_materials(materials)
        if (bake := self._assigned.get(materials)) is None:
            store = ObjectMaterialStore(self.store, self.local.embree, materials)
            key = f"{self.key}/objects-{digest(materials)[:16]}"
            self._assigned[materials] = bake = self._assign(store, key, materials)
        return bake

    @cached_property
    def _assigned(self) -> WeakValueDictionary[ObjectMaterials, Self]:
        """Open bakes with object materials, as long as an image uses them."""
        return WeakValueDictionary()

    def _assign(self, store: ObjectMaterialStore, key: str, materials: ObjectMaterials) -> Self:
        fields = read_light_fields(store, key, self.cache)
        fields["views"] = {name: open_view(store, view.index, self.cache, key) for name, view in self.views.items()}
        return replace(self, **fields, object_materials=materials, scene_bake=self)

    @cached_property
    def derived(self) -> ImageFiles:
        """Images of the default look, computed once."""
        return ImageFiles(Path(self.key) / "derived", image_code())

    @cached_property
    def edited(self) -> ImageFiles:
        """The newest images of other looks, to open the same look after a restart."""
        return ImageFiles(Path(self.key) / "edited", image_code(), _EDITED_BYTES)

    def has_image(self, key: Hashable) -> bool:
        """True if the image of a term is saved beside the store; the key does not include the store's."""
        return self.derived.has(key) or self.edited.has(key)

    @cached_property
    def local(self) -> LocalLights:
        """Local lights of the scene."""
        return LocalLights(self.store, self.cache, self.key)

    @cached_property
    def own_images(self) -> OwnImages:
        """The scene's textures as images of looks."""
        return OwnImages(self.key, self.store)

    def with_own_images(self, look: Look) -> Look:
        """Name the scene's own textures in materials with a transform. See `FixedViewTransfer`."""
        return self.own_images.look(look)

    @cached_property
    def tracer(self) -> NormalRetracer:
        """Tracer for normals that were not baked."""
        return NormalRetracer(self.store, self.local, None)

    @cached_property
    def lights(self) -> TriangleLights:
        """The environment's triangles."""
        return read_lights(self.store)

    def environment_radiance(self, name: str | None) -> Shaped[NDArray[np.float32], "height width 3"]:
        """Return the radiance of an environment, None for the scene's own.

        Raises:
            NotFoundError: it does not exist here. SceneError: its files are damaged.
        """
        return load_environment(name).radiance if name is not None else self._scene_radiance()

    def _scene_radiance(self) -> F32:
        def read() -> F32:
            return np.asarray(self.store.read("lights/environment"), np.float32)

        return self.cache.get_value((self.key, "environment"), read)

    def environment_lights(self, environment: EnvironmentKey, quality: LightQuality) -> TriangleLights:
        """Return the triangles of an environment: the tiles of the bake with new weights."""
        environment = environment.unlinked
        if quality is LightQuality.PREVIEW:  # a large map takes seconds
            return self.coarse_weights("lights", environment, self.environment_radiance)
        if quality is LightQuality.MERGED:
            return self._merged_lights(environment)
        return self.lights if environment == BAKED_ENVIRONMENT else self._integrate_environment(environment)

    def direct_lights(self, light: Illumination, quality: LightQuality) -> TriangleLights:
        """Return the environment triangles for direct illumination of the image."""
        return displayed_of(self.environment_lights(light.environment, quality), light)

    def _merged_lights(self, environment: EnvironmentKey) -> TriangleLights:
        def merge() -> TriangleLights:
            lights = self.environment_lights(environment, LightQuality.EXACT)
            return cluster_lights(lights, self.tiles, num_clusters(self.num_lights))

        return self.cache.get_value((self.key, "merged lights", environment), merge)

    def _integrate_environment(self, environment: EnvironmentKey) -> TriangleLights:
        def integrate() -> TriangleLights:
            return integrate_environment(
                self.tiles,
                EnvironmentTexels.from_radiance(self.environment_radiance(environment.map)),
                environment.rotation,
            )

        return self.cache.get_value((self.key, "lights", environment), integrate)

    def coarse_weights(
        self, label: str, environment: EnvironmentKey, find_radiance: Callable[[str | None], F32]
    ) -> TriangleLights:
        """Approximate the triangles of a part of an environment by a small map.

        Caches everything that rotation does not change.

        Args:
            label: name of the part. environment: with that part. find_radiance: returns the part by environment name.
        """

        def integrate() -> TriangleLights:
            rotatable = self._coarse_texels(label, environment.map, find_radiance)
            return integrate_environment(self.tiles, rotatable, environment.rotation)

        return self.cache.transient.get_value((self.key, f"preview {label}", environment), integrate)

    def coarse_texels(self, name: str | None) -> EnvironmentTexels:
        """Return the texels of a small map of an environment, before any rotation; see `environment_radiance`."""
        return self._coarse_texels("lights", name, self.environment_radiance)

    def _coarse_texels(
        self, label: str, name: str | None, find_radiance: Callable[[str | None], F32]
    ) -> EnvironmentTexels:
        """Return the same of a part of an environment, cached: rotation does not change them."""

        def read() -> EnvironmentTexels:
            return EnvironmentTexels.from_radiance(halve_to_width(find_radiance(name), PREVIEW_WIDTH))

        return self.cache.get_value((self.cache_owner(name), f"texels of preview {label}", name), read)

    def cache_owner(self, name: str | None) -> str:
        """Return the owner of cache entries of an environment: the bake, if it is the scene's own."""
        return self.key if name is None else "environments"

    @cached_property
    def shadow_ray_directions(self) -> Shaped[F32, "M 3"]:
        """Directions of the baked shadow rays."""
        return read_shadow_ray_directions(self.store)

    @cached_property
    def tiles(self) -> Tiles:
        """Spherical tiles of the lights."""
        return read_tiles(self.store)

    @property
    def indirect(self) -> IndirectSolver | None:
        """Indirect illumination: none was baked."""
        return None

    def samples(self, view: View, material: int, cache: Cache) -> Samples:
        """Return all samples of a material. See `FixedViewTransfer`."""
        return MaterialSamples(view, material, self.local, cache, (self.key, *view.sample_key(material)))

    def selected_samples(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " m"], *, has_indirect: bool
    ) -> SelectedSamples:
        """Select samples of a material. See `FixedViewTransfer`."""
        shading_points = view.receivers(material, is_lit=False).without_light(sample_indices)
        visible = np.asarray(view.read_rows("visibility", material, sample_indices), np.uint8)
        return SelectedSamples(replace(shading_points, visible=visible), self.local)

    def unoccluded_samples(self, points: SurfacePoints) -> Samples:
        """Return points to which nothing occludes the environment. See `FixedViewTransfer`."""
        visible = above_horizon(points.normal, self.shadow_ray_directions)
        return SelectedSamples(ShadingPoints(points, points.normal, visible), self.local, is_occluded=False)

    def incident_light(
        self,
        samples: Samples,
        light: Illumination,
        quality: LightQuality = LightQuality.EXACT,
        is_canceled: Callable[[], bool] = lambda: False,
        lobe: LobeSampling | None = None,
        patch_light: Illumination | None = None,
    ) -> LightsAndPoints:
        """Return the incident light at samples. See `FixedViewTransfer`."""
        key = light.environment.unlinked
        if lobe is not None or quality is LightQuality.EXACT:
            lights, new_tiles = displayed_of(self.refined.exact(key).lights, light), self.refined.new_tiles(key)
        else:
            lights = self.direct_lights(light, quality)
            new_tiles = self.refined.strong_tiles(key) if quality is LightQuality.PREVIEW else None
        receivers = samples.receivers(is_lit=lights.num_lights > 0, new_tiles=new_tiles, is_canceled=is_canceled)
        receivers = self._linked(receivers, light)
        rays: list[RayList] = []
        if lobe is not None:
            lights, receivers = self._share_with_rays(lights, receivers, light, lobe)
            rays.append(self._lobe_rays(samples, receivers, light, lobe, quality, is_canceled, patch_light))
        if light.paths.has_indirect and (lobe is None or not lobe.is_narrow.all()):
            gather_rays = self._gather_rays(samples, light, quality, is_canceled)
            rays.extend(gather_rays if lobe is None else (only_broad(each, receivers, lobe) for each in gather_rays))
        followed = self._followed_materials(light) if lobe is not None and lobe.is_narrow.all() else ()
        rays += [*self._mirror_rays(samples, light, followed), *samples.local_rays(light, receivers.points)]
        return lights, replace(receivers, rays=tuple(rays))

    @cached_property
    def refined(self) -> RefinedEnvironments:
        """Environments in tiles that are small where their light is."""
        return RefinedEnvironments(self)

    def preview_highlights(
        self,
        samples: Samples,
        light: Illumination,
        is_canceled: Callable[[], bool] = lambda: False,
        max_lights: int | None = None,
    ) -> LightsAndPoints:
        """Return the incident light at samples for the highlights of a preview. See `FixedViewTransfer`."""
        lights, receivers = self.incident_light(samples, light, LightQuality.PREVIEW, is_canceled)
        if not lights.num_lights:
            return lights, receivers
        lights, baked = self.refined.of_highlights(light.environment.unlinked)
        lights = displayed_of(lights, light)
        if max_lights is not None:
            brightest = np.sort(np.argsort(-lights.irradiance.sum(axis=1), kind="stable")[:max_lights])
            lights, baked = lights.select(brightest, lights.irradiance[brightest]), baked[brightest]
        visible = select_visibility(receivers.visible, np.arange(receivers.points.num_points), baked)
        return lights, replace(receivers, visible=visible)

    def _linked(self, receivers: ShadingPoints, light: Illumination) -> ShadingPoints:
        """Return receivers whose visibility is zero where the environment does not light the surface."""
        link = light.environment.link
        if link is None:
            return receivers
        visible = receivers.visible.copy()
        self.local.linked.darken(link, receivers.points, visible)
        return replace(receivers, visible=visible)

    @staticmethod
    def _followed_materials(light: Illumination) -> list[int]:
        """Return the materials from which lobe rays go on."""
        reflectances = light.reflectances if light.paths.has_all_bounces else ()
        return [index for index, each in enumerate(reflectances) if reflects_narrowly(each)]

    def _share_with_rays(
        self, lights: TriangleLights, receivers: ShadingPoints, light: Illumination, lobe: LobeSampling
    ) -> LightsAndPoints:
        """Return the environment triangles that share their light with lobe rays, and their visibility."""
        shared = self._shared_triangles(light, lobe)
        if not lights.num_lights or len(shared) == lights.num_lights:
            return lights, receivers
        every_row = np.arange(receivers.points.num_points)
        visible = select_visibility(receivers.visible, every_row, shared)
        return lights.select(shared, lights.irradiance[shared]), replace(receivers, visible=visible)

    def _shared_triangles(self, light: Illumination, lobe: LobeSampling) -> NDArray[np.intp]:
        """Return the triangles that share their light with rays: all, if wide levels have no rays."""
        lights = self.refined.exact(light.environment.unlinked).lights
        return bright_triangles(lights) if lobe.is_narrow.all() else np.arange(lights.num_lights)

    def _lobe_rays(
        self,
        samples: Samples,
        receivers: ShadingPoints,
        light: Illumination,
        lobe: LobeSampling,
        quality: LightQuality,
        is_canceled: Callable[[], bool],
        patch_light: Illumination | None,
    ) -> LobeRays:
        """Return the rays along a lobe, which carry light of patches and of the environment."""
        pattern, images = self.lobe_tracer.pattern(lobe, quality), self._hit_images(light)
        narrow = narrow_surfaces(light.reflectances) if light.paths.has_all_bounces else ()
        key = digest((pattern.num_rays, *lobe.identity, narrow, images))
        outgoing = None if patch_light is None else self.patch_light(patch_light, is_canceled)
        footprint, scene = samples.pixel_footprint(receivers), self.lobe_scene(light, is_canceled, outgoing)
        hits = samples.lobe_hits(key, lambda: trace_lobes(scene, receivers, footprint, pattern, is_canceled))
        hits, environment, peaks = scene.links.lit_hits(hits, receivers.points), NO_ENVIRONMENT, NO_PEAKS
        if light.has_environment:
            environment, peaks = self._lobe_environment(light, self._shared_triangles(light, lobe))
        light_args = scene.outgoing, scene.textured, environment, scene.broad_share
        return LobeRays(hits, pattern, *light_args, footprint, scene.surfaces, peaks, scene.emission)

    def split_light(
        self,
        view: View,
        material: int,
        light: Illumination,
        lobe: LobeSampling,
        unsplit: Callable[[], Shaped[F32, "n 3"]],
        is_canceled: Callable[[], bool],
        patch_light: Illumination | None = None,
    ) -> SplitLight | None:
        """Return the light at samples in whose pixels a highlight varies. See `FixedViewTransfer`."""
        return split_light(self, view, material, light, lobe, unsplit, is_canceled, patch_light)

    @cached_property
    def shaded_geometry(self) -> SceneBuffers:
        """The triangles with the normals of their corners, without tangents and textures; a store may lack them."""
        return with_normals(self.tracer.geometry, self.lobe_tracer.normals)

    def few_lobe_rays(
        self, light: Illumination, is_canceled: Callable[[], bool], quality: LightQuality = LightQuality.EXACT
    ) -> FewLobeRays:
        """Prepare images of narrow terms by few rays a sample. See `FixedViewTransfer`."""
        return FewLobeRays.prepare(self, light, is_canceled, quality)

    def local_lobe_lights(self, light: Illumination) -> Sequence[LobeLight]:
        """Return the local lights as narrow lobes see them. light: the illumination"""
        return self.local.local_lobe_lights(light)

    def lobe_scene(
        self,
        light: Illumination,
        is_canceled: Callable[[], bool] = lambda: False,
        outgoing: OutgoingLight | None = None,
    ) -> LobeScene:
        """Return the surfaces that lobe rays meet, with their light.

        Args:
            light: the illumination. is_canceled: polled. outgoing: light of the patches; None: that of `light`.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        reflectances = light.reflectances
        goes_on = light.paths.has_all_bounces and bool(narrow_surfaces(reflectances))
        patch_light = self.patch_light(light, is_canceled) if outgoing is None else outgoing
        light_args = patch_light, material_emissions(light, self.material_names)
        surface_args = reflectances, self._hit_images(light), self._lobe_patches(reflectances)
        links = LightLinks(self.local.linked, light, self.material_names)
        return self.lobe_tracer.scene(*surface_args, *light_args, links, goes_on=goes_on)

    def _hit_images(self, light: Illumination) -> HitImages:
        """Return the images of a look that lobe rays meet."""
        images = emission_images((source.geometry for source in light.local), self.local.emission_image)
        return hit_images(light.reflectances, self.material_names, images_by_material(images))

    def _lobe_patches(self, reflectances: Reflectances) -> LobePatches:
        """Return the textures and reflectances of patches, for lobe rays: there are none."""
        return no_lobe_patches()

    def _lobe_environment(self, light: Illumination, shared: NDArray[np.intp]) -> tuple[LobeEnvironment, LobePeaks]:
        """Return the environment for lobe rays. shared: triangles that share their light with them"""
        key, rotation = light.environment.unlinked, light.environment.rotation
        radiance, refined = self.environment_map(key.map), self.refined.exact(key)

        def tiles_of_texels(tiles: Tiles) -> NDArray[np.int32]:
            texel_args = radiance.shape[:2], rotation
            return self.cache.get_value(
                (self.key, "tile of texels", key, len(tiles.codes)), lambda: tile_of_texels(tiles, *texel_args)
            )

        is_direct = light.paths.direct

        def compute() -> tuple[LobeEnvironment, LobePeaks]:
            gain = np.array(light.environment_gain, np.float32)
            weighted = radiance if np.all(gain == 1) else radiance * gain
            baked = self.environment_lights(key, LightQuality.EXACT)  # in tiles that patches see or do not
            peaks, irradiance, without_peaks = choose_peaks(weighted, tiles_of_texels(self.tiles), baked)
            map_args = weighted, tiles_of_texels(refined.tiles), rotation, refined.lights, without_peaks, shared
            environment = lobe_environment(*map_args, is_direct=is_direct)
            return environment, LobePeaks(baked.direction[peaks], irradiance, self._patch_visibility(peaks))

        cache_key = self.key, "lobe environment", key, light.environment_gain, is_direct, len(shared)
        return self.cache.transient.get_value(cache_key, compute)

    def _patch_visibility(self, lights: Shaped[NDArray[np.intp], " K"]) -> Shaped[F32, "patches K"]:
        """Return the fraction of each patch's points that see some light triangles: there are no patches."""
        return np.zeros((NO_PATCH + 1, len(lights)), np.float32)

    def patch_light(
        self, light: Illumination, is_canceled: Callable[[], bool], quality: LightQuality = LightQuality.EXACT
    ) -> OutgoingLight:
        """Return the outgoing light of patches: there are none.

        Args:
            light: the illumination. is_canceled: polled. quality: of the light.
        """
        return no_light()

    def _gather_rays(
        self, samples: Samples, light: Illumination, quality: LightQuality, is_canceled: Callable[[], bool]
    ) -> tuple[GatherRays, ...]:
        """Return the rays that carry indirect illumination to samples: none was baked."""
        return ()

    def _mirror_rays(self, samples: Samples, light: Illumination, followed: Collection[int]) -> tuple[RayList, ...]:
        """Return the rays from virtual lights in planar mirrors: none was baked."""
        return ()

    @cached_property
    def lobe_tracer(self) -> LobeTracer:
        """Traces lobe rays."""
        return LobeTracer(self.store, self.tracer)

    def downsampled(self, view_name: str, step: int) -> Self:
        """Return one view with 1 / step² of its pixels. Its images are not saved: its key is no folder."""
        index = self.views[view_name].index
        store, key = DownsampledStore(self.store, index, step), f"{self.key}/{step}"
        return replace(self, key=key, store=store, views={view_name: open_view(store, index, self.cache, key)})

    def glass_passages(self, view: View) -> GlassPassages:
        """Return the glass in front of each pixel of a view. See `FixedViewTransfer`."""

        def trace() -> GlassPassages:
            return trace_passages(self.tracer.geometry, view.camera, (view.width, view.height))

        return self.cache.transient.get_value((self.key, "glass passages", view.name), trace)

    def is_emissive_at(self, view: View, material: int) -> Shaped[NDArray[np.bool_], " n"]:
        """True for samples of an emissive material that are visible from an emissive side."""
        return self.local.is_emissive_at(
            material, view.ray_origins(view.rows(material)), view.surface_points(material).position
        )

    def background_in(self, environment: EnvironmentKey, view: View) -> Shaped[NDArray[np.float32], "n 3"]:
        """Return the radiance of a view's background samples; behind frosted glass, the mean about each ray."""
        directions = view.background_directions()
        is_baked = environment.unlinked == BAKED_ENVIRONMENT
        radiance = view.background() if is_baked else self.environment_along(environment, directions)
        for alpha, rows in view.frosted_background():
            turned = rotate_about_y(directions[rows], -environment.rotation).astype(np.float32)
            radiance[rows] = sum(lookup(part, turned) for part in self._frosted_maps(environment.map, alpha))
        return radiance

    def _frosted_maps(self, name: str | None, alpha: float) -> tuple[F32, F32]:
        """Return parts of an environment for rays through frosted glass: without bright lights, and these, wider.

        The facets of glass with a width α rarely face a sun, which would be a few bright pixels.
        """
        owner = self.cache_owner(name)

        def prefilter() -> tuple[F32, F32]:
            radiance = downsampled(self.environment_radiance(name))
            steady = np.minimum(radiance, MAX_FROSTED_RATIO * radiance.mean(axis=(0, 1)))
            spacing, width = math.degrees(RAY_SPACING * alpha), math.degrees(GLOW_WIDTH * alpha)
            return prefiltered(steady, spacing), prefiltered(radiance - steady, width)

        return self.cache.transient.get_value((owner, "environment behind frost", name, alpha), prefilter)

    def environment_along(
        self, environment: EnvironmentKey, directions: Shaped[NDArray[np.float64], "n 3"], blur: float = 0
    ) -> Shaped[F32, "n 3"]:
        """Return the radiance of an environment in unit directions, blurred by `blur` degrees."""
        radiance = self.environment_map(environment.map, blur)
        return lookup(radiance, rotate_about_y(directions, -environment.rotation).astype(np.float32))

    def environment_map(self, name: str | None, blur: float = 0) -> Shaped[F32, "height width 3"]:
        """Return the radiance of an environment, None for the scene's own, blurred by `blur` degrees."""
        return self._prefiltered_map(name, blur) if blur else self.environment_radiance(name)

    def _prefiltered_map(self, name: str | None, degrees: float) -> F32:
        owner = self.cache_owner(name)

        def downsample() -> F32:
            return downsampled(self.environment_radiance(name))

        def prefilter() -> F32:
            return prefiltered(self.cache.get_value((owner, "downsampled environment", name), downsample), degrees)

        return self.cache.transient.get_value((owner, "blurred environment", name, degrees), prefilter)


def displayed_of(lights: TriangleLights, light: Illumination) -> TriangleLights:
    """Return the environment triangles for direct illumination; local lights are separate."""
    if not light.has_direct_environment:
        return lights.empty()
    if light.environment_gain == (1.0, 1.0, 1.0):
        return lights
    return replace(lights, irradiance=lights.irradiance * np.array(light.environment_gain, np.float32))


def read_fields(store: StoreReader, key: str, cache: Cache) -> dict[str, Any]:
    """Read the fields of `BakedFixedViews` from a store.

    Args:
        store: an open store. key: of the bake in the cache. cache: of results computed from the bake.
    Raises:
        StoreError: its description is invalid. ChunkDamagedError: its arrays do not match.
    """
    fields = read_light_fields(store, key, cache)
    views = (open_view(store, k, cache, key) for k in range(len(store.attributes["views"])))
    return {**fields, "views": {view.name: view for view in views}}


def read_light_fields(store: StoreReader, key: str, cache: Cache) -> dict[str, Any]:
    """Read the fields that do not depend on views.

    Args:
        store: an open store. key: of the bake in the cache. cache: of results computed from the bake.
    Raises:
        StoreError: its description is invalid.
    """
    attributes = store.attributes
    try:
        default_look = complete({}, attributes["look"])
        return {
            "cache": cache,
            "key": key,
            "store": store,
            "scene_id": attributes["scene"],
            "method": attributes["method"],
            "num_lights": attributes["num_lights"],
            "default_look": default_look,
            "glass": glass_of(validate(default_look, default_look)),
            "material_names": tuple(attributes["materials"]),
            "views": {},
        }
    except (KeyError, TypeError, IndexError, ParameterError) as error:
        raise StoreError(f"the store's description is invalid ({error}); delete the bake and bake again") from error
