"""What a session needs of the library: a transfer, a picture, and how to get them. Tests put stand-ins here."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import CacheOwner
from relume.live.fixed_camera.fidelity import FidelityLabel
from relume.live.fixed_camera.protocols import OpenBake

if TYPE_CHECKING:
    from relume.live.fixed_camera.jobs import Job
    from relume.live.free_camera.browser.material_arrays import ArrayBlock, ShaderConstants
    from relume.reference import ReferenceImage
    from relume.scene.model import Camera

Tile = tuple[int, int, int, int]
F32 = NDArray[np.float32]


class Progress(Protocol):
    """What one step changed."""

    @property
    def tiles(self) -> Sequence[Tile]: ...
    @property
    def exact(self) -> bool: ...
    @property
    def fidelity(self) -> FidelityLabel:
        """How near what is seen of it is to its look."""
        ...

    @property
    def complete(self) -> bool:
        """Whether something of every term is shown."""
        ...

    @property
    def changed(self) -> bool: ...
    @property
    def previous_error(self) -> float | None:
        """How far the picture that an exact one replaces was from it, relative RMS, where its eye moved."""
        ...


class Picture(Protocol):
    """One live picture; used from one thread at a time."""

    def set_look(self, look: Any, *, active_pointer: str | None, solo: frozenset[str] | None) -> None: ...
    def check(self, look: Any) -> None: ...
    def next_job(self) -> Job | None: ...
    def install(self, job: Any, result: Any) -> None: ...
    def prepare(self, pointer: str) -> None: ...
    def advance(self, max_coefficients: int | None) -> Progress: ...
    def all_tiles(self) -> Sequence[Tile]: ...
    def encode(self, tiles: Sequence[Tile], form: Any, /) -> bytes: ...
    def encode_alpha(self, tiles: Sequence[Tile], /) -> bytes | None: ...
    def image(self) -> F32: ...
    def inspect(self, x: int, y: int) -> Mapping[str, Any]: ...
    def highlight_pixels(self, pointer: str, from_deg: float, to_deg: float) -> F32: ...


class FixedPicture(Picture, Protocol):
    """One from where it was baked."""

    def look_at(self, region: Tile | None) -> None:
        """What is seen of it, and is to be exact first."""
        ...


class FreeCameraPicture(Picture, Protocol):
    """One whose eye moves."""

    renders_pixels: bool

    def set_camera(self, camera: Camera, size: tuple[int, int], *, is_idle: bool) -> None: ...
    def array_blocks(self) -> tuple[Mapping[str, ArrayBlock], ShaderConstants] | None:
        """What a shader needs to draw it, None where it is a fixed picture now."""
        ...


class PlacementViewport(Protocol):
    """A scene as cameras are placed in it; see `relume.output.open_viewport`."""

    @property
    def default_camera(self) -> Camera: ...
    @property
    def bounds_min(self) -> NDArray[np.float64]: ...
    @property
    def bounds_max(self) -> NDArray[np.float64]: ...
    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.uint8]: ...
    def point_at(self, camera: Camera, size: tuple[int, int], x: float, y: float) -> NDArray[np.float64] | None: ...


@dataclass(frozen=True)
class Library:
    """How transfers are opened and pictures made; one per app.

    Attributes:
        open_transfer: path of a published store -> transfer; heavy.
        open_transient: the same for work that nobody watches: what it makes is the first to be forgotten.
        make_picture: (transfer, view name) -> picture, its caches shared; heavy.
        render: (transfer, view name, complete look) -> (H, W, 3 or 4) linear radiance in the baked size, with coverage
            where the look's background is transparent; `progress`, `is_canceled`, `for_display` and `eye` as of
            `render_image`; `exact`, where the eye moves: not as it looks meanwhile; heavy.
        render_small: (transfer, view name, complete look, width) -> the same with fewer pixels, but at least `width`
            columns where the bake has them.
        reference: (folder of a scene, camera, complete look, size, spp, progress, cancelled, pass index,
            reflects=whether surfaces light each other, is_whole=whether all light paths are asked for) -> pictures by
            brute force, `relume.reference.ReferenceImage`; heavy.
        open_viewport: folder of a scene -> what cameras are placed in it by; heavy where nobody has asked for a while.
        shader_arrays: transfer of a moving view -> what its shaders are written from, and the arrays that they keep.
        bytes_by_owner: what the memory of all that was made from bakes holds now: kind and bake -> bytes.
        cache_used_bytes: all of it, and what is being made.
        trim_cache: (stores) -> drops what they hold of all others, down to their floor.
    """

    open_transfer: Callable[[Path], OpenBake]
    open_transient: Callable[[Path], OpenBake]
    make_picture: Callable[[Any, str], Picture]
    render: Callable[..., F32]
    render_small: Callable[[Any, str, Any, int], F32]
    reference: Callable[..., ReferenceImage]
    open_viewport: Callable[[Path], PlacementViewport]
    shader_arrays: Callable[[Any], tuple[Mapping[str, Any], Mapping[str, Callable[[], NDArray[Any]]]]]
    bytes_by_owner: Callable[[], Mapping[CacheOwner, int]]
    cache_used_bytes: Callable[[], int]
    trim_cache: Callable[[Collection[Path]], None]
