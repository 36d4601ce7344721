"""What a picture asks of an opened bake, whichever method made it; `relume.methods` implements it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeAlias

import numpy as np
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
    """What a person can change in the pictures of a bake while they look at them."""

    CURVE = "curve"
    PARAMETER = "parameter"
    LIGHT = "light"
    ENVIRONMENT = "environment"
    BOUNCES = "bounces"
    CAMERA = "camera"


class CameraMode(Enum):
    """Where its pictures are seen from: places that were baked, or any."""

    FIXED = "fixed"
    FREE = "free"


LightsAndPoints: TypeAlias = "tuple[TriangleLights, ShadingPoints]"
"""The environment's triangles, and the points that they and rays bring light to."""


class SampledShading(Protocol):
    """A few samples of a material, kept so that they can be shaded in any light at once."""

    @property
    def num_bytes(self) -> int:
        """Memory they hold."""
        ...

    def incident_light(self, light: Illumination) -> LightsAndPoints:
        """What arrives at them in a light, found quickly."""
        ...


class IndirectLight(Protocol):
    """Light that surfaces send onto each other, as far as it can be followed while it changes."""

    @property
    def num_patches(self) -> int:
        """Pieces of surface that send it."""
        ...

    def preview(self, light: Illumination) -> F32:
        """Radiance that they send out. (at least num_cells, 3)"""
        ...

    def preview_delta(self, before: Illumination, after: Illumination) -> F32:
        """How much more they send out after than before, found quickly. (num_cells, 3)"""
        ...


class LocalLightTransport(Protocol):
    """Local lights, as far as they can be followed while they move."""

    def preview(self, geometry: LightGeometry, points: SurfacePoints) -> MovingLight:
        """What comes to points from a light of unit emission, found quickly."""
        ...

    def preview_rays(self, source: LightSource, visible: NDArray[np.uint8]) -> LocalRays:
        """The same as rays, for terms that ask where light comes from. seen: of `MovingLight`"""
        ...

    def unoccluded(self, geometry: LightGeometry, points: SurfacePoints) -> F32:
        """What would come to points from a light of unit emission if nothing were in its way. (n,)"""
        ...


class MirrorLightsDelta(Protocol):
    """How much more flat mirrors throw in one light than in another.

    Attributes:
        patch_radiance: what of it cells on those mirrors send by lobes. (C, 3)
    """

    @property
    def patch_radiance(self) -> F32: ...
    def rays(self, visible: NDArray[np.uint8]) -> MirrorRays:
        """What comes to samples. visible: from `FixedViewTransfer.thrown_to`. (n, bytes)"""
        ...


class CameraView(Protocol):
    """What is seen from a camera: where it is, or where it begins if it moves; and its size in pixels."""

    @property
    def name(self) -> str: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...


class OpenBake(Protocol):
    """One opened bake, shared by all its pictures, whether their eyes move or not.

    Attributes:
        cache: of all that is made from the bake and may be made again.
        key: tells what is made from this bake from what is made from others in the memory.
        default_look: the complete look of the scene as it was imported.
        camera_mode, axes: what its pictures can do; nobody asks for the method's name.
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
    def environment_radiance(self, name: str | None) -> F32:
        """Radiance of an environment, None for the scene's own. (height, width, 3)"""
        ...


class FixedViewTransfer(OpenBake, Protocol):
    """One opened bake of fixed views.

    Attributes:
        num_lights: triangles that its environment was divided into, about.
        derived, edited: images of the look that the scene was imported with, and of others.
        indirect: light between surfaces; None where none was baked.
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
        """Rays for normals that the bake did not know."""
        ...

    def has_image(self, key: Any) -> bool:
        """Whether the image of a term is kept beside the store, under the name of a job without the store's own."""
        ...

    def incident_light(self, view: View, material: int, light: Illumination, cache: Cache) -> LightsAndPoints:
        """What arrives at a material's samples in a light.

        Args:
            view: whose samples. material: index of the material. cache: keeps shadows that must be traced.
        """
        ...

    def solve_indirect_cache(self, light: Illumination, is_canceled: Callable[[], bool]) -> None:
        """Trace what pieces of surfaces lack that send light in a look, where images lean them.

        Args:
            light: with what they reflect. is_canceled: asked now and then.
        Raises:
            CancelledError: `is_canceled` said so.
        """
        ...

    def clustered_lights(self, light: Illumination) -> TriangleLights:
        """The triangles by which light comes straight to a picture, merged into a few that know their parts."""
        ...

    def mirror_lights_of(self, view: View, material: int) -> NDArray[np.uint8] | None:
        """The lights that a material's samples see in flat mirrors; None where that was not baked. (n, bytes)"""
        ...

    def mirror_lights_delta(self, before: Illumination, after: Illumination) -> MirrorLightsDelta | None:
        """How much more flat mirrors throw after than before, in the same environment; None for nothing."""
        ...

    def subset(
        self, view: View, material: int, sample_indices: NDArray[np.integer], *, has_indirect: bool
    ) -> SampledShading:
        """Some of a material's samples.

        Args:
            view: whose samples. material: index of the material. sample_indices: counted from the material's first.
                (k,)
            has_indirect: with light between surfaces, where that was baked; reading its rays takes longest.
        """
        ...

    def unoccluded_environment(
        self, light: Illumination, points: SurfacePoints, *, is_preview: bool
    ) -> LightsAndPoints:
        """What the environment of a light brings to points, seen along their normals, if nothing hides it.

        Args:
            is_preview: found quickly, from a small map.
        """
        ...

    def downsampled(self, view_name: str, step: int) -> Self:
        """One view of the bake with 1 / step² of its pixels, for small pictures."""
        ...

    def is_emissive_at(self, view: View, material: int) -> NDArray[np.bool_]:
        """Whether the samples of a material that shines are seen from a side that does."""
        ...

    def background_in(self, environment: EnvironmentKey, view: View) -> F32:
        """Radiance of a view's samples of an environment. (n, 3)"""
        ...

    def environment_along(self, environment: EnvironmentKey, directions: NDArray[np.float64], blur: float = 0) -> F32:
        """Radiance of an environment in unit directions (n, 3), blurred by `blur` degrees. (n, 3)"""
        ...
