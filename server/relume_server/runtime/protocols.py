"""Interfaces of transfers and images that sessions need; tests replace them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import CacheOwner
from relume.live.fixed_camera.protocols import OpenBake

if TYPE_CHECKING:
    from relume.live.fixed_camera.jobs import Job
    from relume.live.fixed_camera.picture import Progress
    from relume.live.free_camera.browser.material_arrays import ArrayBlock, ShaderConstants
    from relume.output.exr.aovs import AovTracer
    from relume.reference import ReferenceImage
    from relume.scene.model import Camera

Tile = tuple[int, int, int, int]
F32 = NDArray[np.float32]


class Picture(Protocol):
    """A live image; used from one thread at a time."""

    def set_look(self, look: Any, *, active_pointer: str | None, solo: frozenset[str] | None) -> None: ...
    def check(self, look: Any) -> None: ...
    def next_job(self) -> Job | None: ...
    def prepare(self, pointer: str) -> None: ...
    def advance(self, max_coefficients: int | None) -> Progress: ...
    def all_tiles(self) -> Sequence[Tile]: ...
    def encode(self, tiles: Sequence[Tile], form: Any, /) -> bytes: ...
    def encode_alpha(self, tiles: Sequence[Tile], /) -> bytes | None: ...
    def image(self) -> F32: ...
    def inspect(self, x: int, y: int) -> Mapping[str, Any]: ...
    def highlight_pixels(self, pointer: str, from_deg: float, to_deg: float) -> F32: ...


class FixedPicture(Picture, Protocol):
    """A live image of a fixed camera."""

    def look_at(self, region: Tile | None) -> None:
        """Set the visible region, which is computed first."""
        ...


class FreeCameraPicture(Picture, Protocol):
    """A live image of a free camera."""

    renders_pixels: bool

    def set_camera(self, camera: Camera, size: tuple[int, int], *, is_idle: bool) -> None: ...
    def array_blocks(self) -> tuple[Mapping[str, ArrayBlock], ShaderConstants] | None:
        """Shader inputs, None while the image is a static view."""
        ...


class PlacementViewport(Protocol):
    """Preview of a scene for placing cameras; see `relume.output.open_viewport`."""

    @property
    def default_camera(self) -> Camera: ...
    @property
    def bounds_min(self) -> NDArray[np.float64]: ...
    @property
    def bounds_max(self) -> NDArray[np.float64]: ...
    @property
    def interior_camera(self) -> Camera | None: ...
    @property
    def opens_inside(self) -> bool: ...
    def first_obstacle(
        self, path: Sequence[Sequence[float]]
    ) -> tuple[float | None, str | None, tuple[float, float, float] | None]: ...
    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.uint8]: ...
    def clay(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.uint8]: ...
    def point_at(self, camera: Camera, size: tuple[int, int], x: float, y: float) -> NDArray[np.float64] | None: ...


@dataclass(frozen=True)
class Library:
    """Opens transfers and makes images; one per app.

    Attributes:
        open_transfer: path of a published store -> transfer; heavy.
        open_transient: the same for batch work: its results are evicted first.
        make_picture: (transfer, view name) -> live image with shared caches; heavy.
        render: (transfer, view name, complete look) -> (H, W, 3 or 4) linear radiance in the baked size, with coverage
            if the look's background is transparent; `progress`, `is_canceled`, `for_display` and `camera_and_size` as
            for `render_image`; `exact`: for a free camera, instead of the approximate image; heavy.
        render_small: (transfer, view name, complete look, width) -> the same with fewer pixels, but at least `width`
            columns if the bake has them; `camera_and_size` as for `render`.
        small_renderer: (transfer, view name, width, camera and size or None) -> size of the images, and the same as
            a function of the look, which keeps them in the cache.
        reference: (folder of a scene, camera, complete look, size, spp, progress, canceled, pass index, reflects=has
            indirect light, is_whole=all light paths requested) -> `relume.reference.ReferenceImage`; heavy.
        aov_tracer: (transfer, complete look) -> `relume.output.exr.aovs.AovTracer`; heavy.
        open_viewport: folder of a scene -> preview for placing cameras; heavy unless used recently.
        shader_arrays: free-camera transfer -> constants of its shaders, and their arrays.
        bytes_by_owner: memory of all results computed from bakes: kind and bake -> bytes.
        cache_used_bytes: all of it, including results being computed.
        trim_cache: (stores) -> evicts the results of all other stores, down to their floor.
    """

    open_transfer: Callable[[Path], OpenBake]
    open_transient: Callable[[Path], OpenBake]
    make_picture: Callable[[Any, str], Picture]
    render: Callable[..., F32]
    render_small: Callable[[Any, str, Any, int], F32]
    small_renderer: Callable[[Any, str, int, Any], tuple[tuple[int, int], Callable[[Any], F32]]]
    reference: Callable[..., ReferenceImage]
    aov_tracer: Callable[[Any, Any], AovTracer]
    open_viewport: Callable[[Path], PlacementViewport]
    shader_arrays: Callable[[Any], tuple[Mapping[str, Any], Mapping[str, Callable[[], NDArray[Any]]]]]
    bytes_by_owner: Callable[[], Mapping[CacheOwner, int]]
    cache_used_bytes: Callable[[], int]
    trim_cache: Callable[[Collection[Path]], None]
