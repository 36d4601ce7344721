"""The part of a frame that runs in a thread: bring the picture on, encode what the client lacks, pack the message."""

from __future__ import annotations

import io
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import NDArray
from PIL import Image

from relume.imageio import to_bytes, tone_map
from server.live.ports import Picture, Tile
from server.protocol import FrameHeader, FrameTimes

Format = Literal["rgb9e5", "jpeg"]


@dataclass(frozen=True)
class Target:
    """A look that shall be shown.

    Attributes:
        look: validated. document: the same as JSON.
        received_s: when the edit came in; None for the first look and after a change of view.
    """

    look: Any
    document: dict[str, Any]
    revision: int
    received_s: float | None


@dataclass(frozen=True)
class Order:
    """What a turn of the frame loop asks of the picture.

    Attributes:
        target: a new look, or None to refine the one it has.
        shown: the look that the frame will show.
        lacking: tiles that the client has not got in HDR, besides those that this step changes.
        only_exact: send nothing unless the step makes the picture exact.
        partial: show what is there even where something must be frozen or shaded first: the picture is just opening.
    """

    target: Target | None
    shown: Target
    max_coefficients: int | None
    lacking: frozenset[Tile]
    form: Format
    quality: int
    only_exact: bool
    partial: bool
    frame: int
    view: str
    size: tuple[int, int]


@dataclass(frozen=True)
class Painted:
    """What came of an order.

    Attributes:
        waiting: what must be frozen before the picture can show its look, or None.
        tiles: what the step changed.
        message: the packed frame, or None where none is to be sent.
    """

    waiting: str | None
    tiles: Sequence[Tile] = ()
    exact: bool = False
    message: bytes | None = None
    update_ms: float = 0.0
    encode_ms: float = 0.0


def paint(picture: Picture, order: Order) -> Painted:
    """Give the picture its target, advance it, and pack the frame."""
    start_s = time.perf_counter()
    if order.target is not None:
        picture.set_look(order.target.look)
    waiting = picture.waiting()
    if waiting is not None and not order.partial:
        return Painted(waiting)
    advance = picture.advance(order.max_coefficients)
    updated_s = time.perf_counter()
    update_ms = (updated_s - start_s) * 1e3
    if order.only_exact and not advance.exact:
        return Painted(waiting, advance.tiles, False, None, update_ms)
    width, height = order.size
    if order.form == "jpeg":
        tiles: list[Tile] = [(0, 0, width, height)]
        payload = _jpeg(picture, order.quality, order.shown.look.display)
    else:
        tiles = sorted(order.lacking.union(advance.tiles), key=lambda tile: (tile[1], tile[0]))
        payload = picture.encode(tiles, "rgb9e5")
    encode_ms = (time.perf_counter() - updated_s) * 1e3
    received_s = order.target.received_s if order.target is not None else None
    wait_ms = 0.0 if received_s is None else (start_s - received_s) * 1e3
    header = FrameHeader(
        frame=order.frame,
        revision=order.shown.revision,
        view=order.view,
        width=width,
        height=height,
        tiles=tiles,
        format=order.form,
        exact=advance.exact,
        kind="picture",
        ms=times(wait_ms, update_ms, encode_ms),
    )
    return Painted(waiting, advance.tiles, advance.exact, pack(header, payload), update_ms, encode_ms)


def _jpeg(picture: Picture, quality: int, display: Any) -> bytes:
    shown = tone_map(picture.image(), display.exposure, display.tone_map)
    buffer = io.BytesIO()
    Image.fromarray(to_bytes(shown)).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def encode_brush(picture: Picture, pointer: str, from_degrees: float, to_degrees: float) -> bytes:
    """The payload of a brush frame: how much of each pixel comes from that stretch of the curve, 0…255."""
    return to_bytes(picture.brush(pointer, from_degrees, to_degrees)).tobytes()


def pack(header: FrameHeader, payload: bytes) -> bytes:
    """A frame as it goes over the wire."""
    head = header.model_dump_json().encode()
    return b"".join((struct.pack("<I", len(head)), head, payload))


def rounded(bands: NDArray[Any]) -> list[list[float]]:
    """Band values with six digits, as lists: what a plot needs, in half the bytes."""
    return [[float(f"{value:.6g}") for value in channel] for channel in bands.tolist()]


def times(wait_ms: float, update_ms: float, encode_ms: float) -> FrameTimes:
    """Milliseconds, rounded for the header."""
    return FrameTimes(wait=round(wait_ms, 3), update=round(update_ms, 3), encode=round(encode_ms, 3))
