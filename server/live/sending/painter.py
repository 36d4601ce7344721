"""What runs in a thread for a frame: bring the picture on, encode what the client lacks, pack the message."""

from __future__ import annotations

import io
import struct
import time
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, cast

from numpy.typing import NDArray
from PIL import Image

from relume.errors import ParameterError
from relume.imageio.files import to_bytes
from relume.imageio.shrink import shrink
from relume.imageio.tonemap import tone_map
from relume.look.model import DisplayLook
from server.library.ports import Advance, FixedPicture, MovingPicture, Picture, Tile
from server.live.state.target import Eye, Target
from server.wire.protocol import ArrayInfo, FrameHeader, FrameTimes, TablesInfo

if TYPE_CHECKING:
    from relume.moving.shader.tables import Numbers, Part
    from relume.picture.jobs import Job

Format = Literal["rgb9e5", "jpeg"]
_NOTHING = object()


@dataclass(frozen=True)
class FrameRequest:
    """What a turn of the frame loop asks of a picture.

    Attributes:
        target: the look that the frame will show.
        accepting: pictures that have not got that look yet; all take it, or none.
        lacking: tiles that the client has not got in HDR, besides those that this step changes.
        only_exact: send nothing unless the step makes the picture exact, or first what is seen of it.
        region: what is on the client's screen of it; None: all. is_turned: it has not been told to the picture.
        is_moving: a hand waits for it: tiles out of sight come when it rests.
        is_seen_exact: the client knows that what it sees is exact.
        is_due: there is something to send even where this step changes nothing.
        is_told: the client knows that what it has is exact.
        size: of the picture. jpeg_size: of a JPEG of it, no larger.
        received_s: when the edit or the eye came in that no frame has answered yet, if there is one.
        eye: that the picture is given before; None where it has its eye, or has none that moves.
        shown_eye: number of the eye that the frame shows.
        known: keys of the parts that the client's shader has, where it draws what moves; else None.
    """

    target: Target
    accepting: Sequence[Picture]
    max_coefficients: int | None
    lacking: frozenset[Tile]
    form: Format
    quality: int
    only_exact: bool
    region: Tile | None
    is_turned: bool
    is_moving: bool
    is_seen_exact: bool
    is_due: bool
    is_told: bool
    received_s: float | None
    eye: Eye | None
    shown_eye: int | None
    known: Mapping[str, Hashable] | None
    frame: int
    view: str
    size: tuple[int, int]
    jpeg_size: tuple[int, int]


@dataclass(frozen=True)
class Painted:
    """What came of a request.

    Attributes:
        job: what must be made before the picture can go on to where it should, or None.
        advance: what the step changed, and what the picture shows since.
        message: the packed frame, or None where none is to be sent.
        started_s: when the thread began, seconds of `time.perf_counter`.
        known: keys of the parts that the client's shader has when it has got the message.
        held_back: tiles that it lacks then.
    """

    job: Job | None
    advance: Advance
    message: bytes | None
    update_ms: float
    started_s: float
    encode_ms: float = 0.0
    known: Mapping[str, Hashable] | None = None
    held_back: frozenset[Tile] = frozenset()

    @property
    def is_exact(self) -> bool:
        """Whether all that the client has is exact when it has got the message."""
        return self.advance.exact and not self.held_back


def accept(pictures: Iterable[Picture], target: Target) -> None:
    """Give pictures a look. Raises what they say where they cannot follow it, or where it needs too much memory."""
    found = list(pictures)
    for picture in found:
        picture.check(target.look)
    for picture in found:
        picture.set_look(target.look, hand=target.hand, solo=target.solo)


def touch(pictures: Iterable[Picture], pointer: str) -> list[Job | None]:
    """Tell pictures which curve or slider the user has in hand; what each of them needs now."""
    found = list(pictures)
    for picture in found:
        picture.touch(pointer)
    return [picture.next_job() for picture in found]


def install(picture: Picture, job: Job, made: Any) -> Job | None:
    """Hand over what was made; what the picture needs next."""
    picture.install(job, made)
    return picture.next_job()


def paint(picture: Picture, request: FrameRequest) -> Painted:
    """Advance the picture as far as it can go now, and pack the frame where there is something to show."""
    start_s = time.perf_counter()
    accept(request.accepting, request.target)
    if request.eye is not None:
        eye = request.eye
        cast("MovingPicture", picture).set_eye(eye.camera, eye.size, rests=eye.rests)
    if request.is_turned:
        cast("FixedPicture", picture).look_at(request.region)
    advance = picture.advance(request.max_coefficients)
    job = picture.next_job()
    updated_s = time.perf_counter()
    update_ms = (updated_s - start_s) * 1e3
    if request.known is not None and (found := cast("MovingPicture", picture).parts()) is not None:
        return _tables(request, advance, job, found, start_s)
    has_news = bool(advance.tiles) or request.is_due
    is_held = request.only_exact and (advance.fidelity != "exact" or request.is_seen_exact)
    is_sent = (has_news or not request.is_told) if advance.exact else (has_news and not is_held)
    if not is_sent:
        return Painted(job, advance, None, update_ms, start_s)
    lacking = request.lacking.union(advance.tiles)
    is_on_its_way = request.is_moving or (job is not None and not advance.exact)
    held_back = _out_of_sight(lacking, request) if is_on_its_way else frozenset()
    if lacking and lacking == held_back and request.received_s is None:  # nobody would see anything of it
        return Painted(job, advance, None, update_ms, start_s, held_back=held_back)
    tiles, payload, alpha = _payload(picture, request, lacking - held_back)
    encode_ms = (time.perf_counter() - updated_s) * 1e3
    of_picture = {
        "tiles": tiles, "format": request.form, "kind": "picture", "alpha": alpha is not None,
        "exact": advance.exact and not held_back,
    }  # fmt: skip
    header = _header(request, advance, times(_waited_ms(request, start_s), update_ms, encode_ms), of_picture)
    message = pack(header, payload + (alpha or b""))
    return Painted(job, advance, message, update_ms, start_s, encode_ms, held_back=held_back)


def _out_of_sight(lacking: frozenset[Tile], request: FrameRequest) -> frozenset[Tile]:
    """Tiles that a frame can do without while its picture is on its way."""
    if request.region is None or request.form == "jpeg":
        return frozenset()
    left, top, across, down = request.region
    return frozenset(
        (x, y, width, height)
        for x, y, width, height in lacking
        if x + width <= left or left + across <= x or y + height <= top or top + down <= y
    )


def _waited_ms(request: FrameRequest, start_s: float) -> float:
    """How long what is answered has waited."""
    return 0.0 if request.received_s is None else (start_s - request.received_s) * 1e3


def _header(request: FrameRequest, advance: Advance, ms: FrameTimes, rest: Mapping[str, Any]) -> FrameHeader:
    return FrameHeader(
        frame=request.frame,
        revision=request.target.revision,
        shared=request.target.shared,
        view=request.view,
        width=request.size[0],
        height=request.size[1],
        fidelity=advance.fidelity,
        complete=advance.complete,
        eye=request.shown_eye,
        was_off=advance.was_off,
        ms=ms,
        **rest,
    )


def _tables(
    request: FrameRequest, advance: Advance, job: Job | None, found: tuple[Mapping[str, Part], Numbers], start_s: float
) -> Painted:
    """Pack what the client's shader lacks; nothing where it has all, and has been told that the look is shown."""
    parts, numbers = found
    known: Mapping[str, Hashable] = request.known or {}
    advance = replace(cast("Any", advance), tiles=[])
    updated_s = time.perf_counter()
    update_ms = (updated_s - start_s) * 1e3
    lacking = [part for name, part in parts.items() if known.get(name, _NOTHING) != part.key]
    if not lacking and request.received_s is None and not request.is_due:
        return Painted(job, advance, None, update_ms, start_s, known=known)
    arrays = {name: array for part in lacking for name, array in part.make().items()}
    infos = [ArrayInfo(name=name, dtype=a.dtype.name, shape=a.shape) for name, a in arrays.items()]
    tables = TablesInfo(**numbers._asdict(), arrays=infos)
    payload = b"".join(array.tobytes() for array in arrays.values())
    encode_ms = (time.perf_counter() - updated_s) * 1e3
    of_tables = {"tiles": [], "format": "arrays", "kind": "tables", "tables": tables, "exact": advance.exact}
    header = _header(request, advance, times(_waited_ms(request, start_s), update_ms, encode_ms), of_tables)
    now_known = {**known, **{name: part.key for name, part in parts.items()}}
    return Painted(job, advance, pack(header, payload), update_ms, start_s, encode_ms, now_known)


def _payload(
    picture: Picture, request: FrameRequest, wanted: frozenset[Tile]
) -> tuple[list[Tile], bytes, bytes | None]:
    """The tiles of a frame, their pixels, and their coverage where they are not opaque."""
    if request.form == "jpeg":
        shown = jpeg_of(picture, request.target.look.display, request.jpeg_size, request.quality)
        return [(0, 0, *request.size)], shown, None
    tiles = sorted(wanted, key=lambda tile: (tile[1], tile[0]))
    return tiles, picture.encode(tiles, "rgb9e5"), picture.encode_alpha(tiles)


def jpeg_of(picture: Picture, display: DisplayLook, size: tuple[int, int], quality: int) -> bytes:
    """A picture as it is displayed, no larger than a size."""
    image = shrink(picture.image(), size)
    try:
        shown = tone_map(image, display.exposure, display.tone_map, quick=True)
    except ParameterError:  # the server has no such view: the editor says so, and shows this
        shown = tone_map(image, display.exposure, "agx")
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
