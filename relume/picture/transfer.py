"""What a picture asks of an opened bake, whichever method made it; `relume.methods` implements it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # a server that only describes its API loads no kernels
    from relume.bake import StoreReader
    from relume.light.triangles import TriangleLights
    from relume.look import EnvironmentKey, LightGeometry
    from relume.memory import Memory
    from relume.operators.image_files import ImageFiles
    from relume.picture.light import Light, Source
    from relume.points import Points
    from relume.project.receivers import LocalRays, Receivers, ThrownRays
    from relume.scene.model import Camera
    from relume.trace.preview_light import PreviewLight
    from relume.views.view import View
    from relume.views.worn_store import Tracer

F32 = NDArray[np.float32]


class Axis(Enum):
    """What a person can change in the pictures of a bake while they look at them."""

    CURVE = "curve"
    PARAMETER = "parameter"
    LIGHT = "light"
    ENVIRONMENT = "environment"
    BOUNCES = "bounces"
    EYE = "eye"


class Eyes(Enum):
    """Where its pictures are seen from: places that were baked, or any."""

    BAKED = "baked"
    FREE = "free"


Arriving: TypeAlias = "tuple[TriangleLights, Receivers]"
"""The environment's triangles, and the points that they and rays bring light to."""


class Few(Protocol):
    """A few samples of a material, kept so that they can be shaded in any light at once."""

    @property
    def num_bytes(self) -> int:
        """Memory they hold."""
        ...

    def arriving(self, light: Light) -> Arriving:
        """What arrives at them in a light, found quickly."""
        ...


class Bounced(Protocol):
    """Light that surfaces send onto each other, as far as it can be followed while it changes."""

    @property
    def num_cells(self) -> int:
        """Pieces of surface that send it."""
        ...

    def preview_under(self, light: Light) -> F32:
        """Radiance that they send out. (at least num_cells, 3)"""
        ...

    def preview_change(self, before: Light, after: Light) -> F32:
        """How much more they send out after than before, found quickly. (num_cells, 3)"""
        ...


class Local(Protocol):
    """Local lights, as far as they can be followed while they move."""

    def preview(self, geometry: LightGeometry, points: Points) -> PreviewLight:
        """What comes to points from a light of unit emission, found quickly."""
        ...

    def preview_rays(self, source: Source, seen: NDArray[np.uint8]) -> LocalRays:
        """The same as rays, for terms that ask where light comes from. seen: of `PreviewLight`"""
        ...

    def unhidden(self, geometry: LightGeometry, points: Points) -> F32:
        """What would come to points from a light of unit emission if nothing were in its way. (n,)"""
        ...


class MoreThrown(Protocol):
    """How much more flat mirrors throw in one light than in another.

    Attributes:
        by_cells: what of it cells on those mirrors send by lobes. (C, 3)
    """

    @property
    def by_cells(self) -> F32: ...
    def rays(self, visible: NDArray[np.uint8]) -> ThrownRays:
        """What comes to samples. visible: from `Transfer.thrown_to`. (n, bytes)"""
        ...


class AnyView(Protocol):
    """What is seen from a camera: where it is, or where it begins if it moves; and its size in pixels."""

    @property
    def name(self) -> str: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...


class Opened(Protocol):
    """One opened bake, shared by all its pictures, whether their eyes move or not.

    Attributes:
        memory: of all that is made from the bake and may be made again.
        key: tells what is made from this bake from what is made from others in the memory.
        default_look: the complete look of the scene as it was imported.
        eyes, axes: what its pictures can do; nobody asks for the method's name.
    """

    @property
    def memory(self) -> Memory: ...
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
    def views(self) -> Mapping[str, AnyView]: ...
    @property
    def eyes(self) -> Eyes: ...
    @property
    def axes(self) -> frozenset[Axis]: ...
    def radiance_of(self, name: str | None) -> F32:
        """Radiance of an environment, None for the scene's own. (height, width, 3)"""
        ...


class Transfer(Opened, Protocol):
    """One opened bake of fixed views.

    Attributes:
        num_lights: triangles that its environment was divided into, about.
        derived, edited: images of the look that the scene was imported with, and of others.
        reflected: light between surfaces; None where none was baked.
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
    def reflected(self) -> Bounced | None: ...
    @property
    def local(self) -> Local: ...
    @property
    def tracer(self) -> Tracer:
        """Rays for normals that the bake did not know."""
        ...

    def has_image(self, key: Any) -> bool:
        """Whether the image of a term is kept beside the store, under the name of a job without the store's own."""
        ...

    def arriving(self, view: View, material: int, light: Light, memory: Memory) -> Arriving:
        """What arrives at a material's samples in a light.

        Args:
            view: whose samples. material: index of the material. memory: keeps shadows that must be traced.
        """
        ...

    def trace_cells(self, light: Light, cancelled: Callable[[], bool]) -> None:
        """Trace what pieces of surfaces lack that send light in a look, where images lean them.

        Args:
            light: with what they reflect. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so.
        """
        ...

    def merged(self, light: Light) -> TriangleLights:
        """The triangles by which light comes straight to a picture, merged into a few that know their parts."""
        ...

    def thrown_to(self, view: View, material: int) -> NDArray[np.uint8] | None:
        """The lights that a material's samples see in flat mirrors; None where that was not baked. (n, bytes)"""
        ...

    def more_thrown(self, before: Light, after: Light) -> MoreThrown | None:
        """How much more flat mirrors throw after than before, in the same environment; None for nothing."""
        ...

    def some(self, view: View, material: int, chosen: NDArray[np.integer], *, reflects: bool) -> Few:
        """Some of a material's samples.

        Args:
            view: whose samples. material: index of the material. chosen: counted from the material's first. (k,)
            reflects: with light between surfaces, where that was baked; reading its rays takes longest.
        """
        ...

    def open_sky(self, light: Light, points: Points, *, is_preview: bool) -> Arriving:
        """What the environment of a light brings to points, seen along their normals, if nothing hides it.

        Args:
            is_preview: found quickly, from a small map.
        """
        ...

    def thinned(self, view_name: str, step: int) -> Self:
        """One view of the bake with 1 / step² of its pixels, for small pictures."""
        ...

    def shines_at(self, view: View, material: int) -> NDArray[np.bool_]:
        """Whether the samples of a material that shines are seen from a side that does."""
        ...

    def background_in(self, environment: EnvironmentKey, view: View) -> F32:
        """Radiance of a view's samples of an environment. (n, 3)"""
        ...

    def seen_in(self, environment: EnvironmentKey, directions: NDArray[np.float64], blur: float = 0) -> F32:
        """Radiance of an environment in unit directions (n, 3), blurred by `blur` degrees. (n, 3)"""
        ...
