"""Work in a thread for one frame: update the image, encode the tiles that the client lacks, pack the message."""

from __future__ import annotations

import io
import struct
import time
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, cast

from numpy.typing import NDArray
from PIL import Image

from relume.core.errors import ParameterError
from relume.image_io.display_transform import to_display
from relume.image_io.downsample import downsample
from relume.image_io.write_image import to_bytes
from relume.live.fixed_camera.fidelity import Fidelity
from relume.look.model import DisplayLook
from relume_server.client_state.target import CameraState, Target
from relume_server.runtime.protocols import FixedPicture, FreeCameraPicture, Picture, Tile
from relume_server.schemas.protocol import ArrayInfo, FrameHeader, FrameTimes, FreeCameraError, SceneUpdate

if TYPE_CHECKING:
    from relume.live.fixed_camera.jobs import Job
    from relume.live.fixed_camera.picture import Progress
    from relume.live.free_camera.browser.material_arrays import ArrayBlock, ShaderConstants

Format = Literal["rgb9e5", "jpeg", "png"]
DISPLAYED: frozenset[str] = frozenset({"jpeg", "png"})
"""Formats of one displayed image of the whole view."""
_NOTHING = object()


@dataclass(frozen=True)
class FrameRequest:
    """Input of one step.

    Attributes:
        target: look of the frame.
        accepting: images that do not have this look yet; all accept it, or none.
        missing_tiles: tiles that the client lacks in HDR, besides those that this step changes.
        only_exact: send nothing unless the step makes the image, or its visible region, exact.
        region: visible region; None: all. has_new_region: the image does not know it yet.
        is_interactive: during a drag: tiles outside the region are sent afterwards.
        is_visible_exact: the client knows that its visible region is exact.
        is_due: there is something to send even if this step changes nothing.
        is_client_exact: the client knows that its image is exact.
        size: size of the image. jpeg_size: size of its JPEG, no larger.
        received_s: time of the edit or camera message that no frame has answered yet, if any.
        camera_state: camera state to set before the step; None if it is set, or fixed.
        camera_seq: sequence number of the camera that the frame shows.
        client_keys: keys of the parts that the client's shader has, if it renders; otherwise None.
    """

    target: Target
    accepting: Sequence[Picture]
    max_coefficients: int | None
    missing_tiles: frozenset[Tile]
    form: Format
    quality: int
    only_exact: bool
    region: Tile | None
    has_new_region: bool
    is_interactive: bool
    is_visible_exact: bool
    is_due: bool
    is_client_exact: bool
    received_s: float | None
    camera_state: CameraState | None
    camera_seq: int | None
    client_keys: Mapping[str, Hashable] | None
    frame: int
    view: str
    size: tuple[int, int]
    jpeg_size: tuple[int, int]


@dataclass(frozen=True)
class Painted:
    """Result of one step.

    Attributes:
        job: what must be computed before the image can reach its target, or None.
        progress: what the step changed, and what the image shows now.
        message: the packed frame, or None.
        started_s: start of the thread, seconds of `time.perf_counter`.
        client_keys: keys of the parts that the client's shader has after the message.
        deferred_tiles: tiles that the client lacks after the message.
    """

    job: Job | None
    progress: Progress
    message: bytes | None
    update_ms: float
    started_s: float
    encode_ms: float = 0.0
    client_keys: Mapping[str, Hashable] | None = None
    deferred_tiles: frozenset[Tile] = frozenset()

    @property
    def is_exact(self) -> bool:
        """True if the client's image is exact after the message."""
        return self.progress.exact and not self.deferred_tiles


def accept(pictures: Iterable[Picture], target: Target) -> None:
    """Set the look of images. Raises their errors if they do not support it, or it needs too much memory."""
    all_pictures = list(pictures)
    for picture in all_pictures:
        picture.check(target.look)
    for picture in all_pictures:
        picture.set_look(target.look, active_pointer=target.active_pointer, solo=target.solo)


def prepare(pictures: Iterable[Picture], pointer: str) -> list[Job | None]:
    """Announce an active control to images; returns the job that each needs."""
    all_pictures = list(pictures)
    for picture in all_pictures:
        picture.prepare(pointer)
    return [picture.next_job() for picture in all_pictures]


def apply(picture: Picture, job: Job, result: Any) -> Job | None:
    """Apply the result of an image's job; returns its next job."""
    job.apply(result)
    return picture.next_job()


def paint(picture: Picture, request: FrameRequest) -> Painted:
    """Advance the image as far as possible now, and pack a frame if there is something to show."""
    start_s = time.perf_counter()
    accept(request.accepting, request.target)
    if request.camera_state is not None:
        camera_state = request.camera_state
        cast("FreeCameraPicture", picture).set_camera(
            camera_state.camera, camera_state.size, is_idle=camera_state.is_idle
        )
    if request.has_new_region:
        cast("FixedPicture", picture).look_at(request.region)
    progress = picture.advance(request.max_coefficients)
    job = picture.next_job()
    updated_s = time.perf_counter()
    update_ms = (updated_s - start_s) * 1e3
    if (
        request.client_keys is not None
        and (shader_data := cast("FreeCameraPicture", picture).array_blocks()) is not None
    ):
        return _pack_scene_update(request, progress, job, shader_data, start_s)
    has_changes = bool(progress.tiles) or request.is_due
    must_wait = request.only_exact and (progress.fidelity != Fidelity.EXACT or request.is_visible_exact)
    should_send = (has_changes or not request.is_client_exact) if progress.exact else (has_changes and not must_wait)
    if not should_send:
        return Painted(job, progress, None, update_ms, start_s)
    missing_tiles = request.missing_tiles.union(progress.tiles)
    is_in_progress = request.is_interactive or (job is not None and not progress.exact)
    deferred_tiles = _tiles_outside_region(missing_tiles, request) if is_in_progress else frozenset()
    if (
        missing_tiles and missing_tiles == deferred_tiles and request.received_s is None
    ):  # all outside the visible region
        return Painted(job, progress, None, update_ms, start_s, deferred_tiles=deferred_tiles)
    tiles, payload, alpha = _payload(picture, request, missing_tiles - deferred_tiles)
    encode_ms = (time.perf_counter() - updated_s) * 1e3
    picture_fields = {
        "tiles": tiles, "format": request.form, "kind": "picture", "alpha": alpha is not None,
        "exact": progress.exact and not deferred_tiles,
    }  # fmt: skip
    header = _header(request, progress, times(_waited_ms(request, start_s), update_ms, encode_ms), picture_fields)
    message = pack(header, payload + (alpha or b""))
    return Painted(job, progress, message, update_ms, start_s, encode_ms, deferred_tiles=deferred_tiles)


def _tiles_outside_region(missing_tiles: frozenset[Tile], request: FrameRequest) -> frozenset[Tile]:
    """Tiles that can be sent later while the image changes."""
    if request.region is None or request.form in DISPLAYED:
        return frozenset()
    left, top, across, down = request.region
    return frozenset(
        (x, y, width, height)
        for x, y, width, height in missing_tiles
        if x + width <= left or left + across <= x or y + height <= top or top + down <= y
    )


def _waited_ms(request: FrameRequest, start_s: float) -> float:
    """Waiting time of the answered message."""
    return 0.0 if request.received_s is None else (start_s - request.received_s) * 1e3


def _header(request: FrameRequest, progress: Progress, ms: FrameTimes, fields: Mapping[str, Any]) -> FrameHeader:
    error = progress.free_camera_error
    return FrameHeader(
        frame=request.frame,
        revision=request.target.revision,
        room_revision=request.target.room_revision,
        view=request.view,
        width=request.size[0],
        height=request.size[1],
        fidelity=progress.fidelity,
        complete=progress.complete,
        camera_seq=request.camera_seq,
        free_camera_error=None if error is None else FreeCameraError(delta_e=error.delta_e, rms=error.rms),
        traces_lobes=progress.traces_lobes,
        ms=ms,
        **fields,
    )


def _pack_scene_update(
    request: FrameRequest,
    progress: Progress,
    job: Job | None,
    shader_data: tuple[Mapping[str, ArrayBlock], ShaderConstants],
    start_s: float,
) -> Painted:
    """Pack the parts that the client's shader lacks; nothing if it has all, and knows that the look is shown."""
    blocks, shader_arrays = shader_data
    client_keys: Mapping[str, Hashable] = request.client_keys or {}
    progress = replace(progress, tiles=[])
    updated_s = time.perf_counter()
    update_ms = (updated_s - start_s) * 1e3
    missing_blocks = [block for name, block in blocks.items() if client_keys.get(name, _NOTHING) != block.key]
    if not missing_blocks and request.received_s is None and not request.is_due:
        return Painted(job, progress, None, update_ms, start_s, client_keys=client_keys)
    arrays = {name: array for block in missing_blocks for name, array in block.make().items()}
    infos = [ArrayInfo(name=name, dtype=a.dtype.name, shape=a.shape) for name, a in arrays.items()]
    scene_update = SceneUpdate(**shader_arrays._asdict(), arrays=infos)
    payload = b"".join(array.tobytes() for array in arrays.values())
    encode_ms = (time.perf_counter() - updated_s) * 1e3
    update_fields = {
        "tiles": [],
        "format": "arrays",
        "kind": "scene_update",
        "scene_update": scene_update,
        "exact": progress.exact,
    }
    header = _header(request, progress, times(_waited_ms(request, start_s), update_ms, encode_ms), update_fields)
    new_client_keys = {**client_keys, **{name: block.key for name, block in blocks.items()}}
    return Painted(job, progress, pack(header, payload), update_ms, start_s, encode_ms, new_client_keys)


def _payload(
    picture: Picture, request: FrameRequest, requested_tiles: frozenset[Tile]
) -> tuple[list[Tile], bytes, bytes | None]:
    """Tiles of a frame, their pixels, and their coverage if they are not opaque."""
    if request.form != "rgb9e5":
        display = request.target.look.display
        is_jpeg = request.form == "jpeg"
        image = (
            encode_jpeg(picture, display, request.jpeg_size, request.quality)
            if is_jpeg
            else encode_png(picture, display)
        )
        return [(0, 0, *request.size)], image, None
    tiles = sorted(requested_tiles, key=lambda tile: (tile[1], tile[0]))
    return tiles, picture.encode(tiles, "rgb9e5"), picture.encode_alpha(tiles)


def encode_jpeg(picture: Picture, display: DisplayLook, size: tuple[int, int], quality: int) -> bytes:
    """Encode an image as displayed, scaled down to a size if needed."""
    displayed = _displayed(downsample(picture.image(), size), display, use_table=True)
    buffer = io.BytesIO()
    Image.fromarray(displayed).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def encode_png(picture: Picture, display: DisplayLook) -> bytes:
    """Encode an image as displayed, without loss; little compression, which would take longer than most links."""
    buffer = io.BytesIO()
    Image.fromarray(_displayed(picture.image(), display, use_table=False)).save(buffer, "PNG", compress_level=1)
    return buffer.getvalue()


def _displayed(image: NDArray[Any], display: DisplayLook, *, use_table: bool) -> NDArray[Any]:
    try:
        return to_bytes(to_display(image, display.transform, use_table=use_table))
    except ParameterError:  # the server lacks the OpenColorIO view: the editor reports it, and shows this
        return to_bytes(to_display(image, replace(display.transform, tone_map="agx")))


def encode_highlight(picture: Picture, pointer: str, from_degrees: float, to_degrees: float) -> bytes:
    """Payload of a highlight frame: contribution of a curve's interval to each pixel, 0…255."""
    return to_bytes(picture.highlight_pixels(pointer, from_degrees, to_degrees)).tobytes()


def pack(header: FrameHeader, payload: bytes) -> bytes:
    """Pack a frame as a binary message."""
    head = header.model_dump_json().encode()
    return b"".join((struct.pack("<I", len(head)), head, payload))


def rounded(bands: NDArray[Any]) -> list[list[float]]:
    """Band values with six digits, as lists: enough for a plot, in half the bytes."""
    return [[float(f"{value:.6g}") for value in channel] for channel in bands.tolist()]


def times(wait_ms: float, update_ms: float, encode_ms: float) -> FrameTimes:
    """Milliseconds, rounded for the header."""
    return FrameTimes(wait=round(wait_ms, 3), update=round(update_ms, 3), encode=round(encode_ms, 3))
