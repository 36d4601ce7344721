"""An opened bake of the method `probes`: surfaces visible to a free camera, and their incident light."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.texture_slots import EmissionImage
from relume.core.cache import Cache
from relume.lights.spherical_triangles import TriangleLights
from relume.live.fixed_camera.illumination import Illumination, LightSource, direct_environment, unlinked
from relume.live.fixed_camera.jobs import CancelCheck
from relume.live.fixed_camera.protocols import CameraMode, EditAxis, LightQuality
from relume.live.free_camera.environment_lookup import EnvironmentLookup
from relume.live.free_camera.free_view import FreeView
from relume.live.free_camera.hard_shadow_lights import HardShadowLight, hard_shadow_lights, local_shadow_targets
from relume.live.free_camera.highlights.light_sum_kernel import EnvironmentLights
from relume.live.free_camera.highlights.lobe_light_lists import LobeLightLists
from relume.live.free_camera.lobe_lights import LobeLight
from relume.live.free_camera.occluded_probes import find_occluded_probes
from relume.live.free_camera.ray_scene import OcclusionMesh
from relume.live.free_camera.texture_overrides import NO_OVERRIDES, ProbeMapOverrides, overridden_textures
from relume.live.opened.fixed_views import read_light_fields
from relume.live.opened.fixed_views_indirect import BakedIndirectViews
from relume.live.opened.prefiltered_environments import PrefilteredEnvironments
from relume.live.opened.stored_patches import read_patches
from relume.live.opened.sun_extraction import SunExtractor
from relume.look import EnvironmentKey, LightGeometry, Look
from relume.look.glass import GlassOfLook
from relume.look.model import Link
from relume.look.object_materials import ObjectMaterials
from relume.math.zernike import FAST_DEGREE, NUM_FUNCTIONS
from relume.methods.baked_error import BakedError, read_free_camera_error
from relume.methods.mirror_lights import read_mirror_lights
from relume.probes.stored_scene import StoredScene, ray_pattern, read_stored_scene
from relume.probes.triangle_grids import num_nodes
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.interior import Obstacle, Surroundings, find_surroundings, first_obstacle, interior_camera
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import select_visibility
from relume.scene.model import Camera
from relume.store.bake_protocol import StoreReader
from relume.transport.clustered_rays import shared_direction_coefficients, weighted_basis
from relume.transport.direction_bins import DirectionBins, outgoing_bins
from relume.transport.incident_coefficients import incident_coefficients, ray_incident_coefficients
from relume.transport.lobe_scene import LobeScene
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.shading_points import GatherRays, RayList
from relume.views.store_io import read_camera

F32 = NDArray[np.float32]

_PROBES_PER_BATCH = 4096  # probes whose bits are unpacked at once


@dataclass(frozen=True)
class BakedFreeCamera:
    """An open bake with a free camera. See `relume.live.free_camera.protocol`.

    Attributes:
        light_transport: the light of the bake, without views.
        stored_scene: the surfaces for primary visibility.
        views: initial cameras.
        free_camera_error: error of free-camera images, measured by the bake; None if unknown.
    """

    light_transport: BakedIndirectViews
    stored_scene: StoredScene
    views: dict[str, FreeView]
    free_camera_error: BakedError | None = None

    camera_mode = CameraMode.FREE
    axes = BakedIndirectViews.axes | {EditAxis.CAMERA}

    @classmethod
    def from_store(cls, store: StoreReader, key: str, cache: Cache, *, is_measured: bool = True) -> Self:
        """Open a store: an `Opener`.

        Args:
            store: an open store. key: of the bake in the cache. cache: of results computed from the bake.
            is_measured: False while the bake still lacks the error of its images.
        Raises:
            StoreError: its description is invalid. ChunkDamagedError: its arrays do not match.
        """
        light_fields = read_light_fields(store, key, cache)
        light_transport = BakedIndirectViews(
            **light_fields, patches=read_patches(store), mirror_lights=read_mirror_lights(store)
        )
        width, height = store.attributes["size"]
        cameras = (read_camera(store, k) for k in range(len(store.attributes["views"])))
        stored_scene = read_stored_scene(store)
        probe_positions = stored_scene.probes.position
        bounds = probe_positions.min(axis=0).astype(np.float64), probe_positions.max(axis=0).astype(np.float64)
        return cls(
            light_transport,
            stored_scene,
            {camera.name: FreeView(camera, width, height, bounds) for camera in cameras},
            read_free_camera_error(store) if is_measured else None,
        )

    @property
    def object_materials(self) -> ObjectMaterials:
        """Materials of objects that a look has added to those of the scene."""
        return self.light_transport.object_materials

    def with_object_materials(self, materials: ObjectMaterials) -> Self:
        """Return the same bake with object materials of a look. See `OpenBake`."""
        if materials == self.object_materials:
            return self
        light_transport = self.light_transport.with_object_materials(materials)
        return replace(self, light_transport=light_transport, stored_scene=read_stored_scene(light_transport.store))

    def with_own_images(self, look: Look) -> Look:
        """Name the scene's own textures in materials with a transform. See `OpenBake`."""
        return self.light_transport.with_own_images(look)

    @property
    def cache(self) -> Cache:
        """Cache of results computed from the bake."""
        return self.light_transport.cache

    @property
    def key(self) -> str:
        """Path of the store."""
        return self.light_transport.key

    @property
    def scene_id(self) -> str:
        """Id of the baked scene."""
        return self.light_transport.scene_id

    @property
    def method(self) -> str:
        """Name of the method that baked it."""
        return self.light_transport.method

    @property
    def default_look(self) -> dict[str, Any]:
        """The complete look of the scene as it was imported."""
        return self.light_transport.default_look

    @property
    def glass(self) -> GlassOfLook:
        """The glass that rays have met."""
        return self.light_transport.glass

    @property
    def material_names(self) -> Sequence[str]:
        """Material names in the scene's order."""
        return self.light_transport.material_names

    def environment_radiance(self, name: str | None) -> Shaped[F32, "height width 3"]:
        """Return the radiance of an environment, None for the scene's own."""
        return self.light_transport.environment_radiance(name)

    def stored_scene_with(self, overrides: tuple[ProbeMapOverrides, ...]) -> StoredScene:
        """Return the surfaces with material map overrides.

        Args:
            overrides: overrides of each material.
        Raises:
            NotFoundError, SceneError: an image cannot be loaded.
        """
        if all(override == NO_OVERRIDES for override in overrides):
            return self.stored_scene
        key = self.key, "map overrides on surfaces", overrides
        textures = self.cache.get_value(key, lambda: overridden_textures(self.stored_scene, self.positions, overrides))
        return replace(self.stored_scene, **textures._asdict())

    def emission_image(self, geometry: LightGeometry) -> EmissionImage | None:
        """Return the image that a light's surfaces emit. See `LocalLights.emission_image`."""
        return self.light_transport.local.emission_image(geometry)

    @property
    def has_alpha_tested_surfaces(self) -> bool:
        """True if some triangles are alpha-tested."""
        return self.light_transport.local.has_alpha_tested_surfaces

    @property
    def embree(self) -> EmbreeScene:
        """Acceleration structure of the triangles."""
        return self.light_transport.local.embree

    @property
    def positions(self) -> Shaped[F32, "vertices 3"]:
        """Vertex positions of the triangles, meters."""
        return self.light_transport.local.positions

    @cached_property
    def interior_camera(self) -> Camera | None:
        """A camera in the largest room; None if no place in the scene is enclosed."""
        bounds = next(iter(self.views.values())).bounds
        return interior_camera(self.embree, self.stored_scene.face_normal, bounds, "inside")

    def first_obstacle(self, path: Shaped[NDArray[np.float64], "points 3"]) -> Obstacle | None:
        """Find the first surface on a path. path: corners of a polyline, meters"""
        return first_obstacle(self.embree, self.occlusion_mesh.origins, path)

    def surroundings(self, position: Shaped[NDArray[np.float64], " 3"]) -> Surroundings:
        """Find the surfaces around a point. position: meters"""
        return find_surroundings(self.embree, self.stored_scene.face_normal, position[None])[0]

    @cached_property
    def occlusion_mesh(self) -> OcclusionMesh:
        """Geometry for occlusion rays between surface points."""
        return OcclusionMesh.build(self.stored_scene, self.positions, self.embree)

    @cached_property
    def has_occluded_neighbor(self) -> Shaped[NDArray[np.uint8], " nodes"]:
        """Nodes with an occluded neighbor, from `relume.live.free_camera.occluded_probes`."""
        return find_occluded_probes(self.occlusion_mesh)

    @cached_property
    def visible(self) -> Shaped[NDArray[np.uint8], "probes bytes"]:
        """Visibility of the light triangles from the probes: triangle l in bit l & 7 of byte l >> 3."""
        return np.asarray(self.light_transport.store.read("probes/visibility"), np.uint8)

    @cached_property
    def _gather_hits(self) -> NDArray[np.uint16]:
        return np.asarray(self.light_transport.store.read("probes/gather_hits"), np.uint16)

    def vectors(self, element: Illumination, without_sun_disks: bool = False) -> Shaped[F32, "probes 3 K"]:
        """Return the incident radiance coefficients of all probes for one source and light path with gain 1.

        Args:
            element: that light. without_sun_disks: excludes direct illumination from sun disks.
        """
        key = self._vectors_key(element, without_sun_disks)
        return self.cache.get_value(key, lambda: self._vectors(element, without_sun_disks))

    def has_vectors(self, element: Illumination, without_sun_disks: bool = False) -> bool:
        """Return True if these vectors are in the cache."""
        return self.cache.contains(self._vectors_key(element, without_sun_disks))

    def _vectors_key(self, element: Illumination, without_sun_disks: bool) -> tuple[Hashable, ...]:
        return self.key, "incident coefficients", element, without_sun_disks and self.sun_disks.are_in(element)

    def _vectors(self, element: Illumination, without_sun_disks: bool) -> F32:
        on_all, link = unlinked(element)
        if link is not None:
            return self._darkened(self.vectors(on_all, without_sun_disks), link)
        probes = self.stored_scene.probes
        rays: list[RayList] = list(self.light_transport.local.rays_to(element, probes, is_coarse=True))
        if element.paths.has_indirect:
            outgoing = self.light_transport.indirect_at_probes.outgoing_light(element)
            rays.append(GatherRays(self._gather_hits, self._pattern, outgoing))
        lights = self._direct_lights(element, LightQuality.EXACT, without_sun_disks)
        return incident_coefficients(probes, self.visible, lights, rays)

    def _direct_lights(self, element: Illumination, quality: LightQuality, without_sun_disks: bool) -> TriangleLights:
        find_lights = self.sun_disks.remaining_lights if without_sun_disks else self.light_transport.direct_lights
        return find_lights(element, quality)

    def fast_vectors(
        self, element: Illumination, probe_indices: Shaped[NDArray[np.intp], " m"], without_sun_disks: bool = False
    ) -> Shaped[F32, "m 3 k"]:
        """Approximate the incident radiance coefficients of some probes, with a low degree.

        Args:
            element, without_sun_disks: as in `vectors`. probe_indices: the probes.
        """
        on_all, link = unlinked(element)
        if link is not None:
            return self._darkened(self.fast_vectors(on_all, probe_indices, without_sun_disks), link, probe_indices)
        probes, rays = self.stored_scene.probes.rows(probe_indices), list[RayList]()
        if element.paths.direct:
            for source in element.local:
                visible = self.light_transport.local.preview(source.geometry, probes).visible
                rays.append(self.light_transport.local.preview_rays(source, visible))
        vectors = ray_incident_coefficients(probes, rays, FAST_DEGREE)
        lights = self._direct_lights(element, LightQuality.PREVIEW, without_sun_disks)
        if lights.num_lights:
            vectors += self._preview_environment(lights, probes, probe_indices)
        if element.paths.has_indirect:
            solution = self.light_transport.indirect_at_probes.solve_indirect(
                element, LightQuality.PREVIEW, is_for_rays=True
            )
            vectors += self._ray_vectors(solution.along_rays(is_smoothed=False), probe_indices)
        return vectors

    def indirect_delta(
        self, before: Illumination, after: Illumination, probe_indices: Shaped[NDArray[np.intp], " m"]
    ) -> Shaped[F32, "m 3 k"]:
        """Approximate the change of indirect light at some probes, as coefficients of a low degree.

        Args:
            before, after: lights of the same sources. probe_indices: the probes.
        """
        change = self.light_transport.indirect_at_probes.solve_indirect(after, LightQuality.EXACT, start_from=before)
        return self._ray_vectors(change.along_rays(is_smoothed=False), probe_indices)

    def _ray_vectors(self, outgoing: OutgoingLight, probe_indices: NDArray[np.intp]) -> F32:
        return shared_direction_coefficients(
            self._gather_hits, self._hit_bins, probe_indices, self._ray_basis, outgoing
        )

    @property
    def _hit_bins(self) -> DirectionBins:
        def compute() -> DirectionBins:
            return outgoing_bins(
                self.stored_scene.probes, self._gather_hits, self._pattern, self.light_transport.patches.frames
            )

        return self.cache.get_value((self.key, "direction bins of gather rays"), compute)

    @cached_property
    def sun_disks(self) -> SunExtractor:
        """Sun disks of environments, and the remaining light."""
        return SunExtractor(self.light_transport)

    def hard_shadow_lights(
        self, light: Illumination, probe_indices: Shaped[NDArray[np.intp], " m"] | None
    ) -> tuple[HardShadowLight, ...]:
        """Return sun disks and small area lights, with their unoccluded light at some probes (None: all)."""
        probes = self.stored_scene.probes if probe_indices is None else self.stored_scene.probes.rows(probe_indices)
        sun_lights, link = self.sun_disks.hard_shadow_lights(light, probes), light.environment.link
        shadow_lights = [
            *(sun._replace(vectors=self._darkened(sun.vectors, link, probe_indices)) for sun in sun_lights),
            *(self._hard_shadow_light(source, probes, probe_indices) for source in hard_shadow_lights(light)),
        ]
        return (
            tuple(shadow_lights)
            if probe_indices is None
            else tuple(shadow_light.scatter(probe_indices, self.vectors_shape) for shadow_light in shadow_lights)
        )

    def _hard_shadow_light(
        self, source: LightSource, probes: SurfacePoints, probe_indices: NDArray[np.intp] | None
    ) -> HardShadowLight:
        local, (geometry, gain) = self.light_transport.local, source
        rays = local.unoccluded_rays(geometry._replace(link=None), probes)
        vectors = self._darkened(ray_incident_coefficients(probes, [rays]), geometry.link, probe_indices)
        casters = local.linked.casters(geometry.shadow_link)
        return HardShadowLight(geometry, local_shadow_targets(geometry), vectors, np.array(gain, np.float32), casters)

    def _preview_environment(
        self, lights: TriangleLights, probes: SurfacePoints, probe_indices: NDArray[np.intp]
    ) -> F32:
        """Compute an environment's coefficients at some probes, by spherical harmonics if the bake has them."""
        harmonic = self.light_transport.harmonic
        if harmonic is None:
            return incident_coefficients(probes, self.visible[probe_indices], lights, (), FAST_DEGREE)
        split = harmonic.frequency_split(lights)
        visible = select_visibility(self.visible, probe_indices, split.residual_triangles)
        residual = incident_coefficients(probes, visible, split.residual, (), FAST_DEGREE)
        return residual + harmonic.probe_transfer.incident_coefficients(split.low_frequency, probe_indices)

    @cached_property
    def _ray_basis(self) -> F32:
        return weighted_basis(self._pattern, 0, FAST_DEGREE)  # all points have one seed

    def unoccluded(self, light: Illumination, material: int, *, is_preview: bool) -> Shaped[F32, "probes 3"]:
        """Return the radiance of white probes of a material without occlusion; zero for other materials.

        Args:
            light: direct illumination by environment and area lights; emissive surfaces are excluded.
            material: material of the probes. is_preview: approximates environments other than the baked one.
        """
        rows, cache = np.flatnonzero(self.stored_scene.material == material), self.cache.transient
        key = self.key, "unoccluded light", material

        def compute_environment() -> F32:
            on_all = light._replace(environment=light.environment.unlinked)
            return self._unoccluded_environment(on_all, self.stored_scene.probes.rows(rows), is_preview=is_preview)

        def compute_local(geometry: LightGeometry) -> F32:
            on_all = geometry._replace(link=None, shadow_link=None)
            return self.light_transport.local.unoccluded(on_all, self.stored_scene.probes.rows(rows))

        environment = cache.get_value((*key, light.environment.unlinked, is_preview), compute_environment)
        environment = self._darkened(environment, light.environment.link, rows)
        radiance = environment * np.array(light.environment_gain, np.float32)
        for geometry, gain in light.local:
            if not geometry.material_emissions:
                irradiance = cache.get_value((*key, geometry), lambda geometry=geometry: compute_local(geometry))  # type: ignore[misc]
                irradiance = self._darkened(irradiance, geometry.link, rows)
                radiance += np.outer(irradiance, np.array(gain, np.float32) / np.float32(np.pi))
        out = np.zeros((self.stored_scene.probes.num_points, 3), np.float32)
        out[rows] = radiance
        return out

    def _unoccluded_environment(self, light: Illumination, probes: SurfacePoints, *, is_preview: bool) -> F32:
        """Return the radiance of white probes under the whole environment, per distinct normal. (n, 3) float32"""
        _, first, normal_index = np.unique(probes.normal, axis=0, return_index=True, return_inverse=True)
        quality = LightQuality.PREVIEW if is_preview else LightQuality.EXACT
        receivers = self.light_transport.unoccluded_samples(probes.rows(first)).receivers(is_lit=True)
        lights = self.light_transport.direct_lights(direct_environment(light), quality)
        # the first function is constant: its coefficient is proportional to the irradiance
        constant = incident_coefficients(receivers.points, receivers.visible, lights, (), 0)[:, :, 0]
        return np.asarray(constant[normal_index.ravel()] / np.float32(np.sqrt(np.pi)), np.float32)

    @cached_property
    def _pattern(self) -> RayPattern:
        return ray_pattern(self.light_transport.store, self._gather_hits.shape[1])

    @property
    def num_patches(self) -> int:
        """Number of patches with indirect light."""
        return self.light_transport.patches.num_patches

    @property
    def vectors_shape(self) -> tuple[int, int, int]:
        """Shape of `vectors`: probes, channels, K."""
        return self.stored_scene.probes.num_points, 3, NUM_FUNCTIONS

    @cached_property
    def _prefiltered(self) -> PrefilteredEnvironments:
        return PrefilteredEnvironments(self.light_transport)

    def light_visibility_bits(self, link: Link | None) -> Shaped[NDArray[np.uint8], "probes bytes"]:
        """Return the visibility of the light triangles from the probes, with adjacent triangles in sequence.

        Args:
            link: the surfaces that the environment lights; triangles are not visible from others.
        """
        if link is None:
            return self._light_visibility_bits

        def compute() -> NDArray[np.uint8]:
            return self._darkened(self._light_visibility_bits, link)

        return self.cache.transient.get_value((self.key, "visible lights", link), compute)

    def check_links(self, links: Iterable[Link]) -> None:
        """See `relume.live.opened.linked_surfaces.LinkedSurfaces.check`."""
        self.light_transport.local.check_links(links)

    def _darkened(
        self, values: NDArray[Any], link: Link | None, probe_indices: NDArray[np.intp] | None = None
    ) -> NDArray[Any]:
        """Return values of probes (None: all) that are zero where a light with this link does not light the surface."""
        if link is None:
            return values
        is_lit = self._is_lit(link) if probe_indices is None else self._is_lit(link)[probe_indices]
        return values * is_lit.reshape(-1, *[1] * (values.ndim - 1))

    def _is_lit(self, link: Link) -> Shaped[NDArray[np.bool_], " probes"]:
        """True for the probes of linked surfaces; a ray from a probe at an edge would miss its surface."""
        lattice_nodes, grid = self.stored_scene.lattice_nodes, self.stored_scene.probe_grid
        is_lit_face = np.repeat(self.light_transport.local.linked.faces(link), 2)
        node = grid.node_index[np.repeat(is_lit_face, num_nodes(grid.num_rows.ravel()))]
        is_lit = np.zeros(self.stored_scene.probes.num_points, np.bool_)
        is_lit[lattice_nodes.probe[node][lattice_nodes.weight[node] > 0]] = True
        return is_lit

    @cached_property
    def _light_visibility_bits(self) -> Shaped[NDArray[np.uint8], "probes bytes"]:
        order, out = self._prefiltered.order, np.empty_like(self.visible)
        for rows in np.array_split(np.arange(len(out)), len(out) // _PROBES_PER_BATCH + 1):
            bits = np.unpackbits(self.visible[rows], axis=1, bitorder="little")
            bits[:, : len(order)] = bits[:, order]
            out[rows] = np.packbits(bits, axis=1, bitorder="little")
        return out

    def lobe_lights(self, environment: EnvironmentKey, widths: tuple[int, ...]) -> LobeLightLists:
        """Return the light triangles of an environment, listed by direction for lobes of some widths."""
        return self._prefiltered.directional_lights(environment, widths)

    def environment_lights(self, environment: EnvironmentKey, *, is_preview: bool) -> EnvironmentLights:
        """Return an environment's lights for highlights. is_preview: approximates other than the baked environment."""
        return self._prefiltered.combined(environment, is_preview=is_preview)

    def bright_lights(self, environment: EnvironmentKey) -> Shaped[F32, "lights 7"]:
        """Return the bright lights of an environment, rotated; see `PrefilteredEnvironment`."""
        return self._prefiltered.bright_lights(environment)

    def prefiltered(self, name: str | None) -> EnvironmentLookup:
        """Return an environment (None: the scene's own), and its blurred versions without bright lights."""
        return self._prefiltered.environment_lookup(name)

    def lobe_scene(self, light: Illumination, is_canceled: CancelCheck = lambda: False) -> LobeScene:
        """Return the surfaces that lobe rays meet, with their light. See `FreeCameraTransfer`."""
        return self.light_transport.lobe_scene(light, is_canceled)

    def local_lobe_lights(self, light: Illumination) -> Sequence[LobeLight]:
        """Return the local lights as narrow lobes see them. light: the illumination"""
        return self.light_transport.local_lobe_lights(light)

    def environment_map(self, name: str | None, blur: float = 0) -> Shaped[F32, "height width 3"]:
        """Return the radiance of an environment, None for the scene's own, blurred by `blur` degrees."""
        return self.light_transport.environment_map(name, blur)
