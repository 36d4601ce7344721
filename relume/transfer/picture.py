"""One live picture: a view under a look that changes while somebody drags."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.curves import curve_bands, generated_bands
from relume.errors import ParameterError
from relume.imageio import to_bytes
from relume.look import Look
from relume.transfer.backdrop import Backdrop
from relume.transfer.cache import FrozenCache
from relume.transfer.changeover import Changeover
from relume.transfer.fidelity import Fidelity, worst
from relume.transfer.following import RowsNeed
from relume.transfer.glimpse import Glimpse
from relume.transfer.light_mode import LightMode
from relume.transfer.need import Candidate, Hand, Need, check_room, next_need
from relume.transfer.opened import Transfer
from relume.transfer.pointer import (
    CurvePointer,
    ParameterPointer,
    moved_parameter,
    parse_curve,
    parse_pointer,
)
from relume.transfer.probe import brush, probe
from relume.transfer.resolve import encode, resolve
from relume.transfer.shade import Shaded
from relume.transfer.view import Tile
from relume.transfer.view_images import ViewImages

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Advance:
    """What one step changed.

    Attributes:
        tiles: x, y, width, height of the picture's tiles that are new. exact: the picture shows its look exactly.
        fidelity: how nearly it shows it. complete: something of every term is shown.
    """

    tiles: list[Tile]
    exact: bool
    fidelity: Fidelity
    complete: bool

    @property
    def changed(self) -> bool:
        """Whether any pixel may be new."""
        return bool(self.tiles)


class Picture:
    """State of one session's picture; used from one thread at a time, while a `Need` is made in another.

    Args:
        is_watched: somebody looks at it while it opens, and sees a rough picture first where a better one takes long.
    """

    def __init__(self, transfer: Transfer, view_name: str, cache: FrozenCache, *, is_watched: bool = False) -> None:
        self._images = ViewImages(transfer, view_name, cache)
        self._view = self._images.view
        self._look = self._images.default
        self._radiance = np.zeros((3, self._view.num_view_samples), np.float32)
        self._gain = np.full(3, -1.0)  # no environment's: nothing is shown yet
        self._backdrop = Backdrop(self._images)
        self._touched: CurvePointer | ParameterPointer | None = None
        self._moved: ParameterPointer | None = None
        self._light_mode, self._changeover = LightMode(self._images), Changeover(self._images)
        self._is_to_open = is_watched

    def set_look(self, look: Look) -> None:
        """A new target; nothing is computed yet."""
        before, images = self._images.light, self._images
        images.set_look(look)
        self._light_mode.follow_look(before, look)
        if (images.light.environment, images.light.local) != (before.environment, before.local):
            self._touched = None  # the hand has moved on to a light
        self._moved = moved_parameter(self._look, look)
        self._look = look

    def touch(self, pointer: str) -> None:
        """Prepare what a hand takes hold of ahead of its first edit.

        Args:
            pointer: e.g. "/materials/Teapot/terms/1/curves/theta_h"; see `parse_pointer`.
        Raises:
            ParameterError: there is no such curve or parameter in this look.
            MemoryBudgetError: its operator is larger than the cache may be.
        """
        touched = parse_pointer(pointer)
        self._light_mode.hold(touched, self._look)
        if isinstance(touched, CurvePointer | ParameterPointer):
            check_room(self._images, Candidate(*self._images.find(touched), self._images.along(touched)))
            self._touched = touched

    def waiting(self) -> Need | RowsNeed | Glimpse | None:
        """What must be made next, for the look or for what was touched; None where nothing is lacking.

        The picture may be advanced meanwhile: all that does not depend on it follows the look.

        Raises:
            MemoryBudgetError: something that the look lacks is larger than the cache may be.
        """
        if self._is_to_open:
            self._is_to_open = False
            self._light_mode.preview()
        of_light = self._light_mode.next_need()
        of_look = of_light or next_need(self._images, Hand(self._find(self._touched), self._find(self._moved)))
        return of_look or self._light_mode.held_need()

    def adopt(self, need: Need | RowsNeed | Glimpse, made: Any) -> None:
        """Go on with what a need has made, unless the look has moved on to where it is of no use."""
        if not isinstance(need, Need):
            self._light_mode.adopt(need, made)
            self._change_over(need)
            return
        image = need.image
        if not any(image is known for known in need.material.terms) or image.kind != need.kind:
            return
        is_current = need.key == self._images.key(need.material, image, need.active, of_target=True)
        if isinstance(made, Shaded):
            if image.effective is None or (image.is_near and is_current):
                image.show(made, need.bands)
        elif need.active is not None and is_current:
            image.adopt(made, need.active)
            touched = self._find(self._touched)
            if touched is not None and touched.image is image and touched.along != need.active:
                self._touched = None  # the hand has moved on to something else of this term

    def freeze(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> None:
        """Make what `waiting` names and adopt it.

        Raises:
            CancelledError: `cancelled` said so; the picture stays as it was.
            MemoryBudgetError: it is larger than the cache may be.
        """
        need = self.waiting()
        if need is not None:
            self.adopt(need, need.make(progress, cancelled))

    def advance(self, max_coefficients: int | None) -> Advance:
        """Bring the picture towards its look: R += T · Δc with the most important coefficients, None for all."""
        images = self._images
        self._change_over()
        for material in images.by_name.values():
            for term in material.changed_terms():
                frozen = images.operator(material, term)
                if frozen is not None:
                    term.step(frozen, max_coefficients)
        tiles: set[Tile] = set()
        light, gain = self._changeover.light, self._backdrop.gain_of(self._changeover.gain, self._look.background)
        is_new_behind = self._backdrop.follow(self._look, light, gain, self._radiance)
        for index, material in enumerate(images.by_name.values()):
            if material.num_samples and material.compose(self._radiance):
                tiles.update(self._view.tiles_of_material[index])
        if is_new_behind or not np.array_equal(self._gain, gain):
            self._gain = gain
            tiles.update(self._view.all_tiles)
        fidelity = worst(image.fidelity for _, image in images.terms())
        complete = not any(image.is_blank for _, image in images.terms())
        in_order = sorted(tiles, key=lambda tile: (tile[1], tile[0]))
        return Advance(in_order, fidelity == "exact", fidelity, complete)

    def _change_over(self, glimpse: RowsNeed | Glimpse | None = None) -> None:
        """Show another light where every term can now be shown in it."""
        self._light_mode.step()
        self._changeover.step(glimpse if isinstance(glimpse, Glimpse) else None)

    def all_tiles(self) -> list[Tile]:
        """Tiles that cover the picture."""
        return self._view.all_tiles

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Payload of a frame, "rgb9e5" or "f32": the tiles one after another, row-major."""
        return encode(self._view, self._radiance, tiles, form, self._gain)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """How much each pixel of tiles hides of display values behind it, a byte each; None where it hides all."""
        if not self._backdrop.is_transparent:
            return None
        alpha = self._backdrop.alpha(for_display=True)
        return b"".join(to_bytes(alpha[y : y + height, x : x + width]).tobytes() for x, y, width, height in tiles)

    def alpha(self, *, for_display: bool) -> F32 | None:
        """The same of the whole picture, or how much it hides of linear radiance. (height, width) float32"""
        return self._backdrop.alpha(for_display=for_display) if self._backdrop.is_transparent else None

    def image(self) -> F32:
        """Linear radiance, nothing where it is transparent. (height, width, 3) float32"""
        whole = [(0, 0, self._view.width, self._view.height)]
        pixels = resolve(self._view, self._radiance, whole, self._gain)
        return pixels.reshape(self._view.height, self._view.width, 3)

    def curve(self, pointer: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bands of a curve as displayed and as its parameters alone would give it. (3, J) each"""
        wanted = parse_curve(pointer)
        _, term = self._images.find(wanted)
        declared = term.term.curve(wanted.name)
        return curve_bands(term.document, declared), generated_bands(term.document, declared)

    def probe(self, x: int, y: int) -> dict[str, Any]:
        """What makes up a pixel, and where its surface is; see `relume.transfer.probe.probe`."""
        return probe(self._images, self._radiance, self._gain, self._touched, x, y)

    def brush(self, pointer: str, from_deg: float, to_deg: float) -> F32:
        """Which pixels a stretch of a curve lights; see `relume.transfer.probe.brush`."""
        return brush(self._images, self._radiance, parse_curve(pointer), from_deg, to_deg)

    def _find(self, pointer: CurvePointer | ParameterPointer | None) -> Candidate | None:
        """What a pointer means in the look as it is now; None where an edit has removed it."""
        if pointer is None:
            return None
        try:
            return Candidate(*self._images.find(pointer), self._images.along(pointer))
        except ParameterError:
            return None
