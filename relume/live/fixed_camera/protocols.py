"""Interface of an open bake for pictures, independent of the method; `relume.live.opened` implements it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self, TypeAlias

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

if TYPE_CHECKING:  # a server that only describes its API loads no kernels
    from relume.brdf.lobe_sampling import LobeSampling
    from relume.brdf.texture_slots import EmissionImage
    from relume.camera.glass_passages import GlassPassages
    from relume.core.cache import Cache
    from relume.lights.spherical_triangles import TriangleLights
    from relume.live.fixed_camera.illumination import Illumination, LightSource
    from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
    from relume.look import EnvironmentKey, LightGeometry, Look
    from relume.look.glass import GlassOfLook
    from relume.look.model import Link
    from relume.look.object_materials import ObjectMaterials
    from relume.operators.image_cache import ImageFiles
    from relume.raytrace.moving_light import MovingLight
    from relume.raytrace.new_tiles import NewTiles
    from relume.raytrace.surface_points import SurfacePoints
    from relume.scene.model import Camera
    from relume.store.bake_protocol import StoreReader
    from relume.transport.lobe_hits import LobeHits
    from relume.transport.shading_points import GatherRays, LocalRays, RayList, ShadingPoints
    from relume.transport.split_light import SplitLight
    from relume.views.map_override_store import RayTracer
    from relume.views.view import View

F32 = NDArray[np.float32]


class EditAxis(Enum):
    """Edits that the pictures of a bake support."""

    CURVE = "curve"
    PARAMETER = "parameter"
    LIGHT = "light"
    ENVIRONMENT = "environment"
    BOUNCES = "bounces"
    CAMERA = "camera"


class CameraMode(Enum):
    """Cameras of the pictures: fixed ones of the bake, or a free camera."""

    FIXED = "fixed"
    FREE = "free"


class LightQuality(Enum):
    """Accuracy of incident light.

    A preview uses a small map of the environment and baked normals of patches; merged light, a few triangles that refer
    to the exact ones.
    """

    PREVIEW = "preview"
    MERGED = "merged"
    EXACT = "exact"


LightsAndPoints: TypeAlias = "tuple[TriangleLights, ShadingPoints]"
"""The environment's triangles, and the shading points that they and rays illuminate."""


class Samples(Protocol):
    """Points that receive light: samples of a material, as far as they are read.

    Attributes:
        mirror_visibility: virtual lights that they see in planar mirrors, as bits; None for none.
    """

    @property
    def mirror_visibility(self) -> Shaped[NDArray[np.uint8], "n bytes"] | None: ...
    @property
    def num_bytes(self) -> int:
        """Memory that they take."""
        ...

    def receivers(
        self, *, is_lit: bool, new_tiles: NewTiles | None = None, is_canceled: Callable[[], bool] = lambda: False
    ) -> ShadingPoints:
        """Return the points without rays.

        Args:
            is_lit: with the visibility of the environment.
            new_tiles: of the environment whose visibility is not baked but traced; None for none.
            is_canceled: polled while it is traced.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        ...

    def gather_rays(self, is_canceled: Callable[[], bool]) -> GatherRays | None:
        """Return their gather rays, without light; missing ones are traced. None if they have none."""
        ...

    def pixel_footprint(self, receivers: ShadingPoints) -> Shaped[F32, "#n 2 2 3"]:
        """Return the change of normals and view directions in each sample's part of a pixel, or `NO_FOOTPRINT`."""
        ...

    def lobe_hits(self, key: Hashable, trace: Callable[[], LobeHits]) -> LobeHits:
        """Return the hits of their lobe rays, cached. key: of the lobe. trace: traces them"""
        ...

    def local_rays(self, light: Illumination, points: SurfacePoints) -> Sequence[LocalRays]:
        """Return the rays of local lights. points: the receivers"""
        ...


class RaysToSamples(NamedTuple):
    """Light along rays to some samples of a material.

    Attributes:
        sample_indices: counted from the material's first. rays: to these.
    """

    sample_indices: Shaped[NDArray[np.integer], " k"]
    rays: RayList


class PatchRadiance(Protocol):
    """Outgoing radiance of patches, or its change."""

    def mean_to_others(self) -> Shaped[F32, "patches 3"]:
        """Return the mean radiance of each patch toward other patches."""
        ...

    def rays_to(self, view: View, material: int) -> RaysToSamples | None:
        """Return the light that samples of a material receive along other rays than gather rays; None for none."""
        ...


class IndirectLight(Protocol):
    """Indirect illumination between patches."""

    def solve_indirect(
        self, light: Illumination, quality: LightQuality, start_from: Illumination | None = None
    ) -> PatchRadiance:
        """Return the outgoing radiance of patches; see `relume.live.opened.indirect_solver`.

        Args:
            light: the illumination. quality: exact, or fast for active edits.
            start_from: light of an earlier solution; the result is then the change from that.
        """
        ...


class LocalLightTransport(Protocol):
    """Transport of local lights that move."""

    def preview(self, geometry: LightGeometry, points: SurfacePoints) -> MovingLight:
        """Return the approximate incident light at points from a light of unit emission."""
        ...

    def preview_rays(self, source: LightSource, visible: Shaped[NDArray[np.uint8], "n bytes"]) -> LocalRays:
        """Return the same as rays, for terms that depend on the incident direction. visible: visibility of
        `MovingLight`
        """
        ...

    def unoccluded(self, geometry: LightGeometry, points: SurfacePoints) -> Shaped[F32, " n"]:
        """Return the unoccluded irradiance at points from a light of unit emission."""
        ...

    def emission_image(self, geometry: LightGeometry) -> EmissionImage | None:
        """Return the image that a light's surfaces emit; None if they emit as in the scene."""
        ...

    def surface_radiance_along(
        self,
        geometry: LightGeometry,
        origins: Shaped[F32, "n 3"],
        directions: Shaped[F32, "n 3"],
        distances: Shaped[F32, " n"],
    ) -> Shaped[F32, " n"]:
        """Return the radiance of a light of unit emission with a surface, along rays from surfaces that it lights.

        Args:
            geometry: see `relume.lights.surface_hits.has_surface`. origins: where the rays start, meters.
            directions: away from the surface. distances: at which they end, meters.
        """
        ...

    def check_links(self, links: Iterable[Link]) -> None:
        """Require that the scene has all objects of some links. Raises ParameterError, StoreError."""
        ...


class CameraView(Protocol):
    """A view of a bake: its camera, or the initial camera if it is free, and its size in pixels."""

    @property
    def name(self) -> str: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...


class OpenBake(Protocol):
    """One open bake, shared by all its pictures, with fixed or free cameras.

    Attributes:
        cache: for everything that can be recomputed from the bake.
        key: identifies results of this bake in the cache.
        default_look: the complete look of the scene as it was imported.
        glass: the glass that its rays have met.
        object_materials: materials of objects that a look has added to those of the scene.
        camera_mode, axes: capabilities of its pictures; callers do not check the method's name.
    """

    @property
    def cache(self) -> Cache: ...
    @property
    def key(self) -> str: ...
    @property
    def scene_id(self) -> str: ...
    @property
    def method(self) -> str: ...
    @property
    def default_look(self) -> dict[str, Any]: ...
    @property
    def glass(self) -> GlassOfLook: ...
    @property
    def material_names(self) -> Sequence[str]: ...
    @property
    def views(self) -> Mapping[str, CameraView]: ...
    @property
    def camera_mode(self) -> CameraMode: ...
    @property
    def axes(self) -> frozenset[EditAxis]: ...
    @property
    def object_materials(self) -> ObjectMaterials: ...
    def with_object_materials(self, materials: ObjectMaterials) -> Self:
        """Return the same bake with the object materials of a look, and no other ones.

        Raises:
            ParameterError, StoreError: see `relume.live.opened.object_material_store.ObjectMaterialStore`.
        """
        ...

    def with_own_images(self, look: Look) -> Look:
        """Return a look in which materials with a transform of texture coordinates name their own textures as images.

        Raises:
            ParameterError, StoreError: see `relume.live.opened.own_images.OwnImages`.
        """
        ...

    def environment_radiance(self, name: str | None) -> Shaped[F32, "height width 3"]:
        """Return the radiance map of an environment, None for the scene's own."""
        ...


class LobeShader(Protocol):
    """Images of narrow terms by few rays a sample; `relume.live.opened.few_lobe_rays` implements it.

    Attributes:
        light: the illumination whose light of patches it has.
    """

    @property
    def light(self) -> Illumination: ...

    def shade(
        self,
        samples: Samples,
        receivers: ShadingPoints,
        view: View,
        material: int,
        light: Illumination,
        document: Mapping[str, Any],
    ) -> Shaped[F32, "n 3"] | None:
        """Return the radiance of samples for a white term, without its texture; None if its lobe is wide.

        Args:
            samples: all samples of a material of a view. receivers: the same, without light.
            view, material: the view, and the index.
            light: the illumination, which differs from its own in reflectances alone. document: the term.
        """
        ...


class FixedViewTransfer(OpenBake, Protocol):
    """One open bake of fixed views.

    Attributes:
        num_lights: approximate number of triangles of its environment.
        derived, edited: image files of the imported look, and of other looks.
        indirect: indirect illumination; None if it was not baked.
    """

    @property
    def store(self) -> StoreReader: ...
    @property
    def views(self) -> Mapping[str, View]: ...
    @property
    def num_lights(self) -> int: ...
    @property
    def derived(self) -> ImageFiles: ...
    @property
    def edited(self) -> ImageFiles: ...
    @property
    def indirect(self) -> IndirectLight | None: ...
    @property
    def local(self) -> LocalLightTransport: ...
    @property
    def tracer(self) -> RayTracer:
        """Ray tracer for normals that differ from the baked ones."""
        ...

    def has_image(self, key: Any) -> bool:
        """Return whether the image of a term is cached on disk, by a job's key without the store's own."""
        ...

    def samples(self, view: View, material: int, cache: Cache) -> Samples:
        """Return all samples of a material, read when they are lit.

        Args:
            view: the view. material: index of the material. cache: holds shadows that must be traced.
        """
        ...

    def selected_samples(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " k"], *, has_indirect: bool
    ) -> Samples:
        """Return some of a material's samples, read now to be lit quickly.

        Args:
            view: the view. material: index of the material. sample_indices: counted from the material's first.
            has_indirect: include indirect light if it was baked; reading its rays takes longest.
        """
        ...

    def unoccluded_samples(self, points: SurfacePoints) -> Samples:
        """Return points to which nothing occludes the environment, viewed along their normals."""
        ...

    def incident_light(
        self,
        samples: Samples,
        light: Illumination,
        quality: LightQuality = LightQuality.EXACT,
        is_canceled: Callable[[], bool] = lambda: False,
        lobe: LobeSampling | None = None,
        patch_light: Illumination | None = None,
    ) -> LightsAndPoints:
        """Return the incident light at samples; missing rays are traced.

        Args:
            samples: samples of this bake. light: the illumination with its reflectances.
            quality: accuracy of the light.
            is_canceled: polled regularly.
            lobe: of the one term that is lit, along which rays are traced; None: light from everywhere.
            patch_light: whose light of patches lobe rays bring; None: of `light`.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        ...

    def preview_highlights(
        self,
        samples: Samples,
        light: Illumination,
        is_canceled: Callable[[], bool] = lambda: False,
        max_lights: int | None = None,
    ) -> LightsAndPoints:
        """Return the incident light at samples for the highlights of a preview: triangles follow the light.

        The visibility of these triangles is that of the tiles of the bake that they are in.

        Args:
            samples, light, is_canceled: as in `incident_light`.
            max_lights: of the environment, the brightest; None: all.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        ...

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
        """Return the light at samples in whose pixels the highlight of a term varies; None if there are none.

        Args:
            view, material: whose samples they are. light: the illumination. lobe: of the term, narrow.
            unsplit: returns the term's radiance at all samples of the material, none of them split; called if no
                samples were chosen yet for this lobe. is_canceled: polled.
            patch_light: as in `incident_light`.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        ...

    def few_lobe_rays(
        self, light: Illumination, is_canceled: Callable[[], bool], quality: LightQuality = LightQuality.EXACT
    ) -> LobeShader:
        """Prepare images of narrow terms by few rays a sample; takes seconds with exact light of patches.

        Args:
            light: the illumination. is_canceled: polled. quality: of the light of patches.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        ...

    def downsampled(self, view_name: str, step: int) -> Self:
        """Return one view of the bake with 1 / step² of its pixels, for thumbnails."""
        ...

    def glass_passages(self, view: View) -> GlassPassages:
        """Return the glass in front of each pixel of a view; the bake has glass."""
        ...

    def is_emissive_at(self, view: View, material: int) -> Shaped[NDArray[np.bool_], " n"]:
        """Return whether the camera sees the emitting side of an emissive material, per sample."""
        ...

    def background_in(self, environment: EnvironmentKey, view: View) -> Shaped[F32, "n 3"]:
        """Return the radiance of an environment at a view's background samples."""
        ...

    def environment_along(
        self, environment: EnvironmentKey, directions: Shaped[NDArray[np.float64], "n 3"], blur: float = 0
    ) -> Shaped[F32, "n 3"]:
        """Return the radiance of an environment in unit directions, blurred by `blur` degrees."""
        ...


class StaticViewFactory(Protocol):
    """Traces a fixed view on demand, as an open bake."""

    def __call__(
        self,
        camera: Camera,
        size: tuple[int, int],
        reflects: bool,
        progress: ProgressCallback,
        is_canceled: CancelCheck,
        *,
        smooths_edges: bool = True,
        glass: GlassOfLook | None = None,
        object_materials: ObjectMaterials = (),
    ) -> FixedViewTransfer:
        """Trace the view; see `relume.live.opened.static_view.StaticViewBuilder.make_static_view`."""
        ...
