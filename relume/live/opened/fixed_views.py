"""Bakes of fixed views, opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment_names import load_environment
from relume.assets.environments.equirect import halve_to_width, lookup, rotate_about_y
from relume.core.cache import Cache
from relume.core.errors import ParameterError, StoreError
from relume.core.source_hash import image_code
from relume.lights.light_clusters import cluster_lights, num_clusters
from relume.lights.local_lights import num_samples
from relume.lights.prefilter import downsampled, prefiltered
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import EnvironmentTexels, TriangleLights, integrate_environment
from relume.live.fixed_camera.illumination import Illumination, with_baked_normals
from relume.live.fixed_camera.protocols import CameraMode, EditAxis, LightsAndPoints
from relume.live.opened.indirect_solver import IndirectSolver
from relume.live.opened.local_lights import LocalLights, ShadowCache
from relume.live.opened.planar_mirror_light import AddedMirrorLights
from relume.live.opened.retrace import NormalRetracer
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey, LightGeometry, complete
from relume.methods.store_layout import read_lights, read_shadow_ray_directions, read_tiles
from relume.operators.image_cache import ImageFiles
from relume.raytrace.surface_points import SurfacePoints
from relume.store.bake_protocol import StoreReader
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.shading_points import GatherRays, RayList, ShadingPoints
from relume.views.downsampled import DownsampledStore
from relume.views.view import View, open_view

PREVIEW_WIDTH = 256
_EDITED_BYTES = 256 << 20

F32 = NDArray[np.float32]
IntegrateEnvironment = Callable[[EnvironmentKey], TriangleLights]
"""Returns the triangles of an environment."""


@dataclass(frozen=True)
class BakedFixedViews:
    """One bake of fixed views with direct illumination; a `relume.live.fixed_camera.protocols.FixedViewTransfer`.

    Attributes:
        cache: cache of results computed from the bake.
        key: path of the store; identifies this bake's entries in the cache.
        default_look: the complete look of the scene as it was imported.
    """

    cache: Cache
    key: str
    store: StoreReader
    scene_id: str
    method: str
    num_lights: int
    default_look: dict[str, Any]
    material_names: Sequence[str]
    views: dict[str, View]

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

    def light_of_environment(self, environment: EnvironmentKey) -> TriangleLights:
        """Return the triangles of an environment: the tiles of the bake with new weights."""
        return self.lights if environment == BAKED_ENVIRONMENT else self._integrate_environment(environment)

    def lights_for(self, light: Illumination) -> TriangleLights:
        """Return the environment triangles for direct illumination of the image."""
        return displayed_of(self.light_of_environment(light.environment), light)

    def clustered_lights(self, light: Illumination) -> TriangleLights:
        """Return the triangles of `lights_for`, merged into a few. See `FixedViewTransfer`."""

        def merge_lights() -> TriangleLights:
            return cluster_lights(
                self.light_of_environment(light.environment), self.tiles, num_clusters(self.num_lights)
            )

        return displayed_of(self.cache.get_value((self.key, "merged lights", light.environment), merge_lights), light)

    def preview_lights_for(self, light: Illumination) -> TriangleLights:
        """Approximate the triangles of `lights_for`."""
        return displayed_of(self.preview_light_of_environment(light.environment), light)

    def _integrate_environment(self, environment: EnvironmentKey) -> TriangleLights:
        def integrate() -> TriangleLights:
            return integrate_environment(
                self.tiles,
                EnvironmentTexels.from_radiance(self.environment_radiance(environment.map)),
                environment.rotation,
            )

        return self.cache.get_value((self.key, "lights", environment), integrate)

    def preview_light_of_environment(self, environment: EnvironmentKey) -> TriangleLights:
        """Return an environment's triangles from a map of at most 256 texels' width: a large one takes seconds."""
        return self.coarse_weights("lights", environment, self.environment_radiance)

    def coarse_weights(
        self, label: str, environment: EnvironmentKey, find_radiance: Callable[[str | None], F32]
    ) -> TriangleLights:
        """Approximate the triangles of a part of an environment; caches everything that rotation does not change.

        Args:
            label: name of the part. environment: with that part. find_radiance: returns the part by environment name.
        """
        key = self.cache_owner(environment.map), f"texels of preview {label}", environment.map

        def integrate() -> TriangleLights:
            rotatable = self.cache.get_value(
                key,
                lambda: EnvironmentTexels.from_radiance(halve_to_width(find_radiance(environment.map), PREVIEW_WIDTH)),
            )
            return integrate_environment(self.tiles, rotatable, environment.rotation)

        return self.cache.transient.get_value((self.key, f"preview {label}", environment), integrate)

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

    def outgoing_patch_light(self, light: Illumination) -> OutgoingLight | None:
        """Return the outgoing light of patches; None if no indirect light reaches the image."""
        return self.indirect.exact(light) if self.indirect is not None and light.paths.has_indirect else None

    def solve_indirect_cache(self, light: Illumination, is_canceled: Callable[[], bool]) -> None:
        """Trace missing rays of patches: there are none. See `FixedViewTransfer`."""

    def indirect_rays(
        self,
        light: Illumination,
        gather_rays: GatherRays,
        mirror_visibility: Shaped[NDArray[np.uint8], "n bytes"] | None,
    ) -> tuple[RayList, ...]:
        """Return the rays that carry indirect illumination to samples.

        Args:
            light: all light of the scene. gather_rays: gather rays of the samples; their `outgoing` is replaced.
            mirror_visibility: lights that the samples see in planar mirrors.
        """
        outgoing = self.outgoing_patch_light(light)
        return () if outgoing is None else (replace(gather_rays, outgoing=outgoing),)

    def incident_light(self, view: View, material: int, light: Illumination, cache: Cache) -> LightsAndPoints:
        """Return incident light of a material's samples; traces shadows not in the cache. See `FixedViewTransfer`."""
        lights = self.lights_for(light)
        receivers = view.receivers(material, is_lit=lights.num_lights > 0)
        return lights, replace(receivers, rays=self._rays(view, material, light, cache))

    def _rays(self, view: View, material: int, light: Illumination, cache: Cache) -> Sequence[RayList]:
        """Return the rays of incident light: those of local lights."""
        if not light.local:
            return ()

        def cached_shadows(geometry: LightGeometry, points: SurfacePoints) -> ShadowCache:
            key = (self.key, *view.sample_key(material), "shadows", geometry)
            num_bytes = len(points.position) * -(-num_samples(geometry, self.local.num_samples(geometry)) // 8)
            return cache.get(key, ShadowCache, num_bytes, lambda: self.local.shadows(geometry, points))

        return self.local.rays_to(light, view.surface_points(material), cached_shadows)

    def mirror_lights_of(self, view: View, material: int) -> Shaped[NDArray[np.uint8], "n bytes"] | None:
        """Return lights visible in planar mirrors: none without gather rays. See `FixedViewTransfer`."""
        return None

    def mirror_lights_delta(self, before: Illumination, after: Illumination) -> AddedMirrorLights | None:
        """Return the change of light from planar mirrors: none. See `FixedViewTransfer`."""
        return None

    def subset(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " m"], *, has_indirect: bool
    ) -> SampledTransfer:
        """Select samples of a material. See `FixedViewTransfer`."""
        shading_points = view.receivers(material, is_lit=False).without_light(sample_indices)
        visible = np.asarray(view.read_rows("visibility", material, sample_indices), np.uint8)
        return SampledTransfer(self, replace(shading_points, visible=visible))

    def unoccluded_environment(
        self, light: Illumination, points: SurfacePoints, *, is_preview: bool
    ) -> LightsAndPoints:
        """Return unoccluded light of the environment at points, viewed along the normals. See `FixedViewTransfer`."""
        direct_light = light._replace(paths=light.paths._replace(direct=True).without_reflections())
        above = points.normal @ self.shadow_ray_directions.T > 0
        visible = np.packbits(above, axis=1, bitorder="little")
        lights = self.preview_lights_for(direct_light) if is_preview else self.lights_for(direct_light)
        return lights, ShadingPoints(points, points.normal, visible)

    def downsampled(self, view_name: str, step: int) -> Self:
        """Return one view with 1 / step² of its pixels. Its images are not saved: its key is no folder."""
        index = self.views[view_name].index
        store, key = DownsampledStore(self.store, index, step), f"{self.key}/{step}"
        return replace(self, key=key, store=store, views={view_name: open_view(store, index, self.cache, key)})

    def is_emissive_at(self, view: View, material: int) -> Shaped[NDArray[np.bool_], " n"]:
        """True for samples of an emissive material that are visible from an emissive side."""
        return self.local.is_emissive_at(
            material, view.ray_origins(view.rows(material)), view.surface_points(material).position
        )

    def background_in(self, environment: EnvironmentKey, view: View) -> Shaped[NDArray[np.float32], "n 3"]:
        """Return the radiance of a view's background samples."""
        if environment == BAKED_ENVIRONMENT:
            return view.background()
        return self.environment_along(environment, view.background_directions())

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


@dataclass(frozen=True)
class SampledTransfer:
    """Selected samples of a material, shaded in any light; a `relume.live.fixed_camera.protocols.SampledShading`.

    Attributes:
        receivers: without rays.
        gather_rays: their gather rays, if baked; without outgoing light.
        mirror_visibility: the lights that they see in planar mirrors, if baked.
    """

    transfer: BakedFixedViews
    receivers: ShadingPoints
    gather_rays: GatherRays | None = None
    mirror_visibility: Shaped[NDArray[np.uint8], "n bytes"] | None = None

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        points, hit_bytes = self.receivers, 0 if self.gather_rays is None else self.gather_rays.gather_hits.nbytes
        return int(
            2 * points.normal.nbytes + points.tangent.nbytes + points.wo.nbytes + points.visible.nbytes + hit_bytes
        )

    def incident_light(self, light: Illumination) -> LightsAndPoints:
        """Return incident light for a preview: a small map of the environment, exact local lights, indirect light.

        Indirect light uses the baked normals, since tracing it for overridden normals takes too long.
        """
        transfer, indirect_rays = self.transfer, tuple[RayList, ...]()
        if self.gather_rays is not None:
            indirect_rays = transfer.indirect_rays(with_baked_normals(light), self.gather_rays, self.mirror_visibility)
        local = transfer.local.rays_to(light, self.receivers.points)
        return transfer.preview_lights_for(light), replace(self.receivers, rays=(*indirect_rays, *local))


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
        return {
            "cache": cache,
            "key": key,
            "store": store,
            "scene_id": attributes["scene"],
            "method": attributes["method"],
            "num_lights": attributes["num_lights"],
            "default_look": complete({}, attributes["look"]),
            "material_names": tuple(attributes["materials"]),
            "views": {},
        }
    except (KeyError, TypeError, IndexError, ParameterError) as error:
        raise StoreError(f"the store's description is invalid ({error}); delete the bake and bake again") from error
