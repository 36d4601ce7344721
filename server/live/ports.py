"""What a session needs of the library: a transfer, a picture, and how to get them. Tests put stand-ins here."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.scene.model import Camera

Tile = tuple[int, int, int, int]
F32 = NDArray[np.float32]


class View(Protocol):
    """A baked view."""

    @property
    def name(self) -> str: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def camera(self) -> Camera: ...
    def material_ids(self) -> NDArray[np.uint16]:
        """(height, width); 65535 is background."""
        ...


class Transfer(Protocol):
    """An opened bake."""

    @property
    def scene_id(self) -> str: ...
    @property
    def method(self) -> str: ...
    @property
    def default_look(self) -> dict[str, Any]: ...
    @property
    def material_names(self) -> Sequence[str]: ...
    @property
    def views(self) -> Mapping[str, Any]: ...
    def radiance_of(self, name: str | None) -> F32:
        """(height, width, 3); None: of the scene's own environment."""
        ...


class Advance(Protocol):
    """What one step changed."""

    @property
    def tiles(self) -> Sequence[Tile]: ...
    @property
    def exact(self) -> bool: ...
    @property
    def fidelity(self) -> Literal["preview", "approximate", "followed", "near", "exact"]: ...
    @property
    def complete(self) -> bool:
        """Whether something of every term is shown."""
        ...

    @property
    def changed(self) -> bool: ...


class Need(Protocol):
    """What a picture waits for; made in any thread while the picture goes on."""

    @property
    def what(self) -> str: ...
    @property
    def state(self) -> Literal["freezing", "shading"]: ...
    @property
    def refines(self) -> bool:
        """Whether the picture is near its look without it, so that it can wait until the hand rests."""
        ...

    @property
    def key(self) -> Hashable: ...
    def make(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> Any: ...


class Picture(Protocol):
    """One live picture; used from one thread at a time."""

    def set_look(self, look: Any) -> None: ...
    def waiting(self) -> Need | None: ...
    def adopt(self, need: Any, made: Any) -> None: ...
    def touch(self, pointer: str) -> None: ...
    def advance(self, max_coefficients: int | None) -> Advance: ...
    def all_tiles(self) -> Sequence[Tile]: ...
    def encode(self, tiles: Sequence[Tile], form: Any, /) -> bytes: ...
    def encode_alpha(self, tiles: Sequence[Tile], /) -> bytes | None: ...
    def image(self) -> F32: ...
    def probe(self, x: int, y: int) -> Mapping[str, Any]: ...
    def brush(self, pointer: str, from_deg: float, to_deg: float) -> F32: ...


@dataclass(frozen=True)
class Library:
    """How transfers are opened and pictures made; one per app.

    Attributes:
        open_transfer: path of a published store -> transfer; heavy.
        make_picture: (transfer, view name) -> picture, its caches shared; heavy.
        render: (transfer, view name, complete look) -> (H, W, 3 or 4) linear radiance in the baked size, with coverage
            where the look's background is transparent; `progress`, `cancelled` and `for_display` as of `render_image`;
            heavy.
        render_small: (transfer, view name, complete look, width) -> the same with fewer pixels, but at least `width`
            columns where the bake has them.
        reference: (folder of a scene, view name, complete look, size, spp, progress, cancelled, pass index,
            reflects=whether surfaces light each other) -> the same by brute force; heavy.
        cache_used_bytes: what the frozen caches hold now.
        shrink_cache: (stores) -> drops what they hold of all others, down to their floor.
    """

    open_transfer: Callable[[Path], Transfer]
    make_picture: Callable[[Any, str], Picture]
    render: Callable[..., F32]
    render_small: Callable[[Any, str, Any, int], F32]
    reference: Callable[..., F32]
    cache_used_bytes: Callable[[], int]
    shrink_cache: Callable[[Collection[Path]], None]
