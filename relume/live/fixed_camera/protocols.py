"""Interface of an open bake for pictures, independent of the method; `relume.live.opened` implements it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeAlias

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

if TYPE_CHECKING:  # a server that only describes its API loads no kernels
    from relume.core.cache import Cache
    from relume.lights.spherical_triangles import TriangleLights
    from relume.live.fixed_camera.illumination import Illumination, LightSource
    from relume.look import EnvironmentKey, LightGeometry
    from relume.operators.image_cache import ImageFiles
    from relume.raytrace.moving_light import MovingLight
    from relume.raytrace.surface_points import SurfacePoints
    from relume.scene.model import Camera
    from relume.store.bake_protocol import StoreReader
    from relume.transport.shading_points import LocalRays, MirrorRays, ShadingPoints
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


LightsAndPoints: TypeAlias = "tuple[TriangleLights, ShadingPoints]"
"""The environment's triangles, and the shading points that they and rays illuminate."""


class SampledShading(Protocol):
    """A subset of a material's samples, cached so that it can be shaded quickly in any light."""

    @property
    def num_bytes(self) -> int:
        """Memory that it takes."""
        ...

    def incident_light(self, light: Illumination) -> LightsAndPoints:
        """Return an approximation of their incident light."""
        ...


class IndirectLight(Protocol):
    """Indirect illumination between patches, as far as interactive updates need it."""

    @property
    def num_patches(self) -> int:
        """Number of patches."""
        ...

    def preview(self, light: Illumination) -> Shaped[F32, "rows 3"]:
        """Return the approximate outgoing radiance of at least `num_patches` patches."""
        ...

    def preview_delta(self, before: Illumination, after: Illumination) -> Shaped[F32, "patches 3"]:
        """Return the approximate change of outgoing radiance per patch."""
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


class MirrorLightsDelta(Protocol):
    """Change of the light that planar mirrors reflect.

    Attributes:
        patch_radiance: its part that patches on those mirrors send by their lobes. (patches, 3)
    """

    @property
    def patch_radiance(self) -> F32: ...
    def rays(self, visible: Shaped[NDArray[np.uint8], "n bytes"]) -> MirrorRays:
        """Return the rays to samples. visible: from `FixedViewTransfer.mirror_lights_of`"""
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
    def material_names(self) -> Sequence[str]: ...
    @property
    def views(self) -> Mapping[str, CameraView]: ...
    @property
    def camera_mode(self) -> CameraMode: ...
    @property
    def axes(self) -> frozenset[EditAxis]: ...
    def environment_radiance(self, name: str | None) -> Shaped[F32, "height width 3"]:
        """Return the radiance map of an environment, None for the scene's own."""
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

    def incident_light(self, view: View, material: int, light: Illumination, cache: Cache) -> LightsAndPoints:
        """Return the incident light at a material's samples.

        Args:
            view: the view. material: index of the material. cache: holds shadows that must be traced.
        """
        ...

    def solve_indirect_cache(self, light: Illumination, is_canceled: Callable[[], bool]) -> None:
        """Trace the rays that patches lack for indirect light if normal-map overrides change their normals.

        Args:
            light: the illumination with its reflectances. is_canceled: polled regularly.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        ...

    def clustered_lights(self, light: Illumination) -> TriangleLights:
        """Return the triangles of direct environment light, merged into a few that refer to their members."""
        ...

    def mirror_lights_of(self, view: View, material: int) -> Shaped[NDArray[np.uint8], "n bytes"] | None:
        """Return the mirror lights that are visible from a material's samples, as bits; None if they were not baked."""
        ...

    def mirror_lights_delta(self, before: Illumination, after: Illumination) -> MirrorLightsDelta | None:
        """Return the change of the light that planar mirrors reflect, in the same environment; None for none."""
        ...

    def subset(
        self, view: View, material: int, sample_indices: Shaped[NDArray[np.integer], " k"], *, has_indirect: bool
    ) -> SampledShading:
        """Return some of a material's samples.

        Args:
            view: the view. material: index of the material. sample_indices: counted from the material's first.
            has_indirect: include indirect light if it was baked; reading its rays takes longest.
        """
        ...

    def unoccluded_environment(
        self, light: Illumination, points: SurfacePoints, *, is_preview: bool
    ) -> LightsAndPoints:
        """Return the unoccluded light of the environment at points that are viewed along their normals.

        Args:
            is_preview: approximate it with a small map.
        """
        ...

    def downsampled(self, view_name: str, step: int) -> Self:
        """Return one view of the bake with 1 / step² of its pixels, for thumbnails."""
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
