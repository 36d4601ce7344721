"""Local lights over a baked store: their shadows are traced on demand, and cached by the caller."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.ies.ies_store import load_web
from relume.brdf.texture_slots import EmissionImage
from relume.core.cache import Cache
from relume.core.errors import StoreError
from relume.images.image_store import load_gobo, load_texture
from relume.lights.light_sampling import LightStrata
from relume.lights.local_lights import (
    LightPoints,
    LocalLight,
    emitter_geometry,
    make_light_strata,
    outer_angle,
    prepare_local_lights,
    source_triangles,
)
from relume.lights.shape_triangles import LightTriangles, sun_triangles
from relume.lights.surface_hits import surface_distance, surface_radiance
from relume.live.fixed_camera.illumination import Illumination, LightSource
from relume.live.free_camera.lobe_lights import LobeEmitter, LobeLight
from relume.live.opened.linked_surfaces import LinkedSurfaces
from relume.look import LightGeometry
from relume.look.model import Link
from relume.methods.store_layout import has_alpha_tested_surfaces, read_alpha_test, read_light_members
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.emission_image import ImageEmitter, image_emitter
from relume.raytrace.intensity_table import Gobo, intensity_table, project_gobo
from relume.raytrace.local_light_visibility import compute_irradiance, trace_light_visibility
from relume.raytrace.moving_light import MovingLight, trace_moving_light
from relume.raytrace.scene_buffers import is_front
from relume.raytrace.source_surfaces import SourceSurfaces
from relume.raytrace.surface_points import SurfacePoints
from relume.store.bake_protocol import StoreReader
from relume.store.optional_arrays import read_optional
from relume.transport.shading_points import LocalRays

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SAMPLES = 64  # of a rectangle, per view sample
FINE_SAMPLE_FACTOR = 4  # of mesh lights, if the scene has few emissive materials, and of many points
MAX_FINE_MESHES = 4
COARSE_SAMPLES = 16  # that stand for parts of a surface in narrow lobes
LOBE_SAMPLES = 256  # of many points, a quarter of how many narrow lobes show: each is a highlight
PREVIEW_SAMPLES = 4  # during an edit of the light
_ONES = np.ones(3, np.float32)


@dataclass(frozen=True)
class ShadowCache:
    """Visibility of a light's samples, as in `LocalRays.visible`."""

    visible: Shaped[NDArray[np.uint8], "n bytes"]

    @property
    def num_bytes(self) -> int:
        """Memory in use."""
        return self.visible.nbytes


class LocalLights:
    """Triangles of a store, and lights among them; shared by all images of the bake.

    Args:
        key: key of the bake in `cache`.
    """

    def __init__(self, store: StoreReader, cache: Cache, key: str) -> None:
        self._store, self._cache, self._key = store, cache, key

    @cached_property
    def positions(self) -> Shaped[F32, "vertices 3"]:
        """Vertex positions of the scene, meters."""
        return np.asarray(self._store.read("scene/positions"), np.float32)

    @cached_property
    def faces(self) -> Shaped[NDArray[np.uint32], "triangles 3"]:
        """Vertex indices of the triangles."""
        return np.asarray(self._store.read("scene/faces"), np.uint32)

    @property
    def has_alpha_tested_surfaces(self) -> bool:
        """True if some triangles are alpha-tested."""
        return has_alpha_tested_surfaces(self._store)

    @cached_property
    def embree(self) -> EmbreeScene:
        """Acceleration structure of the triangles."""
        return EmbreeScene.build(self.positions, self.faces, read_alpha_test(self._store, self.positions, self.faces))

    @cached_property
    def linked(self) -> LinkedSurfaces:
        """The surfaces that lights light, and those that cast their shadows."""
        return LinkedSurfaces(self._store, self.positions, self.faces, self.embree, self._cache, self._key)

    def surface_radiance_along(
        self,
        geometry: LightGeometry,
        origins: Shaped[F32, "n 3"],
        directions: Shaped[F32, "n 3"],
        distances: Shaped[F32, " n"],
    ) -> Shaped[F32, " n"]:
        """Return the radiance of a light of unit emission with a surface, along rays from surfaces that it lights.

        Args:
            geometry: see `has_surface`. origins: where the rays start, meters. directions: away from the surface.
            distances: at which they end, meters.
        """
        if geometry.source:
            radiance = self._source_surfaces(geometry.source).radiance_along(origins, directions, distances)
        else:
            is_hit = surface_distance(geometry, origins, directions) < distances
            radiance = np.where(is_hit, np.float32(surface_radiance(geometry)), np.float32(0))
        return np.where(self.linked.is_lit(geometry.link, origins, directions), radiance, np.float32(0))

    def _source_surfaces(self, source: str) -> SourceSurfaces:
        def build() -> SourceSurfaces:
            members = read_light_members(self._store, source)
            return SourceSurfaces.build(members.light_fields((1.0,)), *self._bounds())

        return self._cache.transient.get_value((self._key, "source surfaces", source), build)

    def check_links(self, links: Iterable[Link]) -> None:
        """See `LinkedSurfaces.check`."""
        self.linked.check(links)

    def num_samples(self, geometry: LightGeometry, rectangle_samples: int = SAMPLES) -> int:
        """Return the number of samples of a light, given that of a rectangle; see `make_light_strata`.

        A mesh has more: parts of it are often occluded, and its housing is close. So have many points, of which the
        close ones are far brighter than the others.
        """
        lights = self._store.attributes["look"]["lights"].values()
        has_few_meshes = sum(light["kind"] == "mesh" for light in lights) <= MAX_FINE_MESHES
        is_fine = geometry.kind == "points" or (geometry.material_emissions and has_few_meshes)
        return rectangle_samples * (FINE_SAMPLE_FACTOR if is_fine else 1)

    def rays_to(
        self,
        light: Illumination,
        points: SurfacePoints,
        find_shadows: Callable[[LightGeometry, SurfacePoints], ShadowCache] | None = None,
        *,
        is_coarse: bool = False,
    ) -> list[LocalRays]:
        """Return the direct illumination of points by local lights, as rays.

        Args:
            light: all light of the image. points: receivers.
            find_shadows: looks shadows up in a cache; None: they are traced.
            is_coarse: without `find_shadows`, for low-degree bases: every light has `SAMPLES`.
        """
        if not light.paths.direct:
            return []
        rays = []
        for geometry, gain in light.local:
            num_samples, emitter = SAMPLES if is_coarse else self.num_samples(geometry), emitter_geometry(geometry)
            visible = (
                self.trace(emitter, points, num_samples)
                if find_shadows is None
                else find_shadows(emitter, points).visible
            )
            rays.append(LocalRays(*self.sample_light(geometry, num_samples), np.array(gain, np.float32), visible))
        return rays

    def local_lobe_lights(self, light: Illumination) -> list[LobeLight]:
        """Return the local lights as narrow lobes see them. light: the illumination"""
        if not light.paths.direct:
            return []
        return [
            LobeLight(self._lobe_emitter(geometry), gain, self.linked.casters(geometry.shadow_link), geometry.link)
            for geometry, gain in light.local
        ]

    def _lobe_emitter(self, geometry: LightGeometry) -> LobeEmitter:
        num_samples = LOBE_SAMPLES if geometry.kind == "points" else COARSE_SAMPLES
        return self._cache.transient.get_value(
            (self._key, "light in lobes", geometry),
            lambda: LobeEmitter.from_light(*self.sample_light(geometry, num_samples)),
        )

    def preview(self, geometry: LightGeometry, points: SurfacePoints) -> MovingLight:
        """Preview a light of unit emission at points, with few samples if it has an extent."""
        casters = self.linked.casters(geometry.shadow_link)
        light = trace_moving_light(casters, *self.sample_light(geometry, PREVIEW_SAMPLES), points)
        self.linked.darken(geometry.link, points, *light)
        return light

    def preview_rays(self, source: LightSource, visible: Shaped[NDArray[np.uint8], "n bytes"]) -> LocalRays:
        """Return rays of a previewed light, for directional terms. visible: `MovingLight.visible`"""
        return LocalRays(
            *self.sample_light(source.geometry, PREVIEW_SAMPLES), np.array(source.gain, np.float32), visible
        )

    def unoccluded_rays(self, geometry: LightGeometry, points: SurfacePoints) -> LocalRays:
        """Return unoccluded light of unit emission at points that it lights, as rays."""
        light, strata = self.sample_light(geometry, SAMPLES)
        visible = np.full((points.num_points, -(-len(strata.uv) // 8)), 255, np.uint8)
        self.linked.darken(geometry.link, points, visible)
        return LocalRays(light, strata, _ONES, visible)

    def unoccluded(self, geometry: LightGeometry, points: SurfacePoints) -> Shaped[F32, " n"]:
        """Return the unoccluded irradiance of points from a light of unit emission."""
        rays = self.unoccluded_rays(geometry, points)
        return compute_irradiance(rays.light, rays.strata, points, rays.visible)

    def shadows(self, geometry: LightGeometry, points: SurfacePoints) -> ShadowCache:
        """Trace the shadows of a light."""
        return ShadowCache(self.trace(geometry, points, self.num_samples(geometry)))

    def is_emissive_at(
        self, material: int, camera_position: Shaped[F32, "*cameras 3"], position: Shaped[F32, "n 3"]
    ) -> Shaped[NDArray[np.bool_], " n"]:
        """True for points of an emissive material that are visible from an emissive side.

        Args:
            material: its index. camera_position: camera position of each point, or one for all.
            position: position of the points.
        """
        if self._is_two_sided(material):
            return np.ones(len(position), np.bool_)
        return is_front(self.embree, self.positions, self.faces, camera_position, position)

    def trace(
        self, geometry: LightGeometry, points: SurfacePoints, num_samples: int
    ) -> Shaped[NDArray[np.uint8], "n bytes"]:
        """Trace the visibility of a light's samples from points that it lights; see `LocalRays.visible`.

        Args:
            geometry: geometry of the light. points: receivers. num_samples: from `LocalLights.num_samples`.
        """
        casters = self.linked.casters(geometry.shadow_link)
        visible = trace_light_visibility(casters, *self.sample_light(geometry, num_samples), points)
        self.linked.darken(geometry.link, points, visible)
        return visible

    def sample_light(self, geometry: LightGeometry, rectangle_samples: int) -> tuple[LocalLight, LightStrata]:
        """Build a light and its samples; see `make_light_strata`."""
        light = self._light(geometry)
        return light, make_light_strata(light, rectangle_samples)

    def _light(self, geometry: LightGeometry) -> LocalLight:
        return self._cache.get_value((self._key, "local light", geometry), lambda: self._build_light(geometry))

    def _build_light(self, geometry: LightGeometry) -> LocalLight:
        if geometry.source:
            return self._build_members(geometry)
        if geometry.kind == "surfaces":
            return prepare_local_lights(geometry, self._surfaces(geometry))
        if geometry.kind != "mesh":
            sun = sun_triangles(geometry, *self._bounds())
            return prepare_local_lights(geometry, sun, intensity_table=self._intensity_table(geometry))
        if geometry.image is not None:
            is_two_sided = self._is_two_sided(self._emissive_faces(geometry.material)[0])
            emitter = self._image_emitter(geometry.material, geometry.image)
            relative_radiance = emitter.relative_radiance(geometry.channel)
            triangles = LightTriangles(emitter.corners, relative_radiance, is_two_sided)
            return prepare_local_lights(geometry, triangles)
        return prepare_local_lights(geometry, self._emissive_triangles(geometry.material))

    def _emissive_triangles(self, name: str) -> LightTriangles:
        """The surfaces of a material with the emission of the scene."""
        material, face_mask = self._emissive_faces(name)
        face_emission = np.ones(np.count_nonzero(face_mask), np.float32)
        if self._store.attributes.get("has_emission_images"):
            face_emission = self._store.read("scene/face_emission")[face_mask]
        return LightTriangles(self.positions[self.faces[face_mask]], face_emission, self._is_two_sided(material))

    def _surfaces(self, geometry: LightGeometry) -> LightTriangles:
        """The surfaces of several materials in one channel; those that emit to both sides twice, once for each."""
        corners, radiance = [], []
        for name, relative in geometry.materials:
            triangles = self._emissive_triangles(name)
            for order in (1, -1) if triangles.is_two_sided else (1,):
                corners.append(triangles.corners[:, ::order])
                radiance.append(triangles.relative_radiance * np.float32(relative[geometry.channel or 0]))
        return LightTriangles(np.concatenate(corners), np.concatenate(radiance), is_two_sided=False)

    def _bounds(self) -> tuple[Shaped[F64, " 3"], float]:
        """Center and radius of a sphere around the scene, meters."""
        low, high = (end(self.positions, axis=0).astype(np.float64) for end in (np.min, np.max))
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2

    def _build_members(self, geometry: LightGeometry) -> LocalLight:
        members = read_light_members(self._store, geometry.source)
        if geometry.kind == "points":
            points = LightPoints(members.position, members.direction, members.cone, members.relative_emission)
            return prepare_local_lights(geometry, points=points)
        return prepare_local_lights(geometry, source_triangles(members.light_fields((1.0,)), *self._bounds()))

    def _intensity_table(self, geometry: LightGeometry) -> Shaped[F32, "polar azimuth"]:
        """Intensity of a light over directions. Raises NotFoundError, SceneError: an asset cannot be loaded."""
        web = None if geometry.profile is None else load_web(geometry.profile)
        gobo = None if geometry.gobo is None else self._gobo(geometry.gobo, geometry.cone[1])
        relative_gobo = None if gobo is None else gobo.relative_intensity(geometry.channel)
        return intensity_table(outer_angle(geometry), web, relative_gobo)

    def _gobo(self, image: str, outer: float) -> Gobo:
        return self._cache.get_value((self._key, "gobo", image, outer), lambda: project_gobo(load_gobo(image), outer))

    def emission_image(self, geometry: LightGeometry) -> EmissionImage | None:
        """Return the image that a light's surfaces emit, or a spot projects; None if it has none.

        Raises:
            NotFoundError, SceneError: the image cannot be loaded. StoreError: the bake is too old for it.
        """
        if geometry.gobo is not None:
            gobo = self._gobo(geometry.gobo, geometry.cone[1])
            return EmissionImage(geometry.gobo, gobo.mean, gobo.is_colored)
        if geometry.image is None:
            return None
        emitter = self._image_emitter(geometry.material, geometry.image)
        return EmissionImage(geometry.image, emitter.mean, emitter.is_colored)

    def _image_emitter(self, material: str, image: str) -> ImageEmitter:
        def compute() -> ImageEmitter:
            faces = self.faces[self._emissive_faces(material)[1]]
            return image_emitter(load_texture(image), self.positions[faces], self._read_uvs()[faces])

        return self._cache.get_value((self._key, "emission image", material, image), compute)

    def _read_uvs(self) -> Shaped[F32, "vertices 2"]:
        uvs = read_optional(self._store, "scene/uvs")
        if uvs is None:
            raise StoreError("this bake is too old for emission images; bake the scene again")
        return uvs

    def _emissive_faces(self, material: str) -> tuple[int, Shaped[NDArray[np.bool_], " triangles"]]:
        """Return the index of a material, and which triangles have it."""
        index = list(self._store.attributes["materials"]).index(material)
        return index, self._store.read("scene/face_material") == index

    def _is_two_sided(self, material: int) -> bool:
        return bool(self._store.attributes["double_sided"][material])
