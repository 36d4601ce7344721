"""Messages of a live session (subprotocol relume.v2); the editor's TypeScript types are generated from them.

Text messages are JSON, at most `MAX_MESSAGE_BYTES`. A binary message is one frame: uint32 little-endian header length,
JSON header (`FrameHeader`), payload. The payload contains the tiles of the header in order, row-major, top row first:
"rgb9e5" 4 bytes per pixel, "f32" 12 bytes per pixel, "jpeg" and "png" one displayed image of the whole view, a JPEG
perhaps with fewer pixels, "r8" one byte per pixel (frames of kind "highlight": 0…255 stands for 0…1). With `alpha` in
the header, one byte of coverage per pixel of the same tiles follows; the radiance is premultiplied. A frame of kind
"scene_update" has no tiles: its payload is the arrays that `scene_update` names, little-endian, in order.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from relume.live.fixed_camera.fidelity import Fidelity
from relume.look.patch import MAX_OPERATIONS
from relume.scene.validate import MAX_LIGHTS
from relume_server.schemas.cameras import MAX_PATH_POINTS, PathPoint
from relume_server.schemas.connection import DrainMessage, OpenMessage, PingMessage, PongMessage
from relume_server.schemas.message import Message, Name, PatchOperation, Pointer, Revision, RoleName
from relume_server.schemas.rooms import CommentsMessage, PresenceMessage, RoomInfo, RoomMessage, RoomUpdate
from relume_worker.status import Phase

SUBPROTOCOL = "relume.v2"
MAX_MESSAGE_BYTES = 64 * 1024
MAX_FRAMES_IN_FLIGHT = 2
MAX_VISIBLE_VIEWS = 4
MAX_CAMERA_PIXELS = 1920 * 1200
# layout version of GET /api/bakes/{id}/probes/…, which is cached forever: clients name it in the URL
PROBES_LAYOUT = 4

Sources = Annotated[list[Name], Field(min_length=1, max_length=MAX_LIGHTS + 1)]
Degrees = Annotated[float, Field(ge=0, le=90, allow_inf_nan=False)]
Pixel = Annotated[int, Field(ge=0, le=65535)]
Extent = Annotated[int, Field(ge=1, le=65535)]
Coordinate = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]


class EditMessage(Message):
    """client → server: change the look; `revision` must be newer than the last. `active_control` is the control that is
    dragged: a curve, or a `parameter` as in `PrepareMessage`, in the look after the edit; null for all other edits.
    `solo` lists the lights, local ones and "environment", that are shown alone from now on, without being part of the
    look; null: all; left out: unchanged. An edit with `solo` may have an empty patch.
    """

    type: Literal["edit"]
    revision: Revision
    patch: Annotated[list[PatchOperation], Field(max_length=MAX_OPERATIONS)]
    active_control: Pointer | None = None
    solo: Sources | None = None

    @property
    def changes_solo(self) -> bool:
        """True if the edit sets `solo`."""
        return "solo" in self.model_fields_set

    @model_validator(mode="after")
    def _is_edit(self) -> EditMessage:
        if not self.patch and not self.changes_solo:
            raise ValueError("give at least one operation in patch, or solo")
        return self


class ViewMessage(Message):
    """client → server: show this view alone. `size` is the client's area in pixels: JPEGs are scaled down to it until
    the next such message; all other frames have the baked size.
    """

    type: Literal["view"]
    name: Name
    size: tuple[Pixel, Pixel] | None = None


class ViewsMessage(Message):
    """client → server: show these views side by side; edits apply to all."""

    type: Literal["views"]
    names: Annotated[list[Name], Field(min_length=1, max_length=MAX_VISIBLE_VIEWS)]


class FocusMessage(Message):
    """client → server: the pointer is in this visible view: its frames and operators have priority."""

    type: Literal["focus"]
    view: Name


class RegionMessage(Message):
    """client → server: visible region of a view with a "fixed" camera: x, y, width, height in pixels of its image. It
    is computed first, approximate frames contain only its tiles, and `fidelity` refers to it. null: the whole image,
    the default.
    """

    type: Literal["region"]
    view: Name
    rect: tuple[Pixel, Pixel, Extent, Extent] | None


class AckMessage(Message):
    """client → server: this frame was received and displayed."""

    type: Literal["ack"]
    frame: Annotated[int, Field(ge=0, le=2**53)]


class EncodingMessage(Message):
    """client → server: encoding of images. "auto": HDR, but JPEG while moving if the connection is too slow for it.
    "png": displayed images without loss, as batch renders have them.
    """

    type: Literal["encoding"]
    format: Literal["hdr", "jpeg", "png", "auto"]
    quality: Annotated[int, Field(ge=1, le=95)] = 80


class InspectMessage(Message):
    """client → server: read a pixel of a visible view, by default the focused one; see `InspectAnswer`."""

    type: Literal["inspect"]
    view: Name | None = None
    x: Pixel
    y: Pixel


class PathMessage(Message):
    """client → server: find the first surface on a path of a "free" camera; see `PathAnswer`. `id` is repeated."""

    type: Literal["path"]
    id: Revision
    points: Annotated[list[PathPoint], Field(min_length=2, max_length=MAX_PATH_POINTS)]


class HighlightMessage(Message):
    """client → server: show the pixels that a curve's interval affects; each visible view answers "highlight"."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_by_name=True, validate_by_alias=True)

    type: Literal["highlight_curve_range"]
    curve: Pointer
    from_degrees: Degrees = Field(alias="from")
    to_degrees: Degrees = Field(alias="to")


class PrepareMessage(Message):
    """client → server: announce an edit. Either of `curve`: precompute it and send its `CurveMessage` from now on; or
    of `parameter`, also a light (/lights/NAME) or a field of the environment: prepare it; the open curve stays open.
    """

    type: Literal["prepare"]
    curve: Pointer | None = None
    parameter: Pointer | None = None

    @model_validator(mode="after")
    def _has_one_target(self) -> PrepareMessage:
        if (self.curve is None) == (self.parameter is None):
            raise ValueError("give either curve or parameter")
        return self


class CameraMessage(Message):
    """client → server: move the "free" camera of a view, with this image size; the latest message counts, and frames
    repeat its `seq` as `camera_seq`. `to_world`, row by row, `yfov` and `near` as in `CameraInfo`. `active_control`: as
    in an edit; nothing is prepared for it. `refine`: "exact": an exact image follows when the camera stops, and edits
    continue in it; "none": none follows.
    """

    type: Literal["camera"]
    view: Name
    seq: Revision
    to_world: Annotated[list[Coordinate], Field(min_length=16, max_length=16)]
    yfov: Annotated[float, Field(gt=0, lt=math.pi, allow_inf_nan=False)]
    near: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    size: tuple[Pixel, Pixel]
    active_control: Pointer | None = None
    refine: Literal["exact", "none"] = "exact"


class RendererMessage(Message):
    """client → server: who renders views with a "free" camera while they move. "client": from now on frames of kind
    "scene_update" contain the shader inputs that GET /api/bakes/{id}/probes does not, each when it changes; moving the
    camera sends no frame. Exact images are sent as before.
    """

    type: Literal["renderer"]
    renderer: Literal["client", "server"]


ClientMessage = Annotated[
    OpenMessage
    | EditMessage
    | ViewMessage
    | ViewsMessage
    | FocusMessage
    | RegionMessage
    | AckMessage
    | EncodingMessage
    | InspectMessage
    | PathMessage
    | HighlightMessage
    | PrepareMessage
    | CameraMessage
    | RendererMessage
    | PresenceMessage
    | PingMessage,
    Field(discriminator="type"),
]
CLIENT_MESSAGE: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)


class Problem(BaseModel):
    """RFC 9457 problem. `type` is the kind, `detail` says what happened and what to do."""

    model_config = ConfigDict(extra="allow", frozen=True)

    type: str
    title: str
    status: int
    detail: str


class CameraInfo(Message):
    """A camera that looks along its -Z. `to_world`: 4 × 4, row by row, rigid, meters. `yfov`: vertical, radians.
    `near`: distance of the near clipping plane, meters.
    """

    to_world: list[float]
    yfov: float
    near: float = 0.0


class ViewInfo(Message):
    """A view, its size in pixels and its camera; `camera_mode`: fixed at the baked camera, or free. For a free camera
    `bounds` are the minimum and maximum corner of the scene, meters, and `interior_camera` is in its largest room.
    """

    name: str
    width: int
    height: int
    camera: CameraInfo
    camera_mode: Literal["fixed", "free"]
    bounds: tuple[list[float], list[float]] | None = None
    interior_camera: CameraInfo | None = None


class FreeCameraError(Message):
    """Error of free-camera images while the camera moves, over surfaces. `delta_e`: mean CIEDE2000 difference of the
    displayed images, about 1 is just noticeable; `rms`: relative RMS error of linear radiance. Standard errors: of
    estimates; null for one whole image.
    """

    delta_e: float
    rms: float
    delta_e_standard_error: float | None = None
    rms_standard_error: float | None = None


class HelloMessage(Message):
    """server → client: first message. `revision` and `solo` are the last ones of a resumed session, otherwise 0 and
    null.

    `visible_views`: views whose frames are sent, `focused_view` one of them; `views`: all baked views. `method`: of the
    bake; `axes`: what edits can change. `role`: with `view` no edits are accepted. `room`: the shared room, null if
    there is none. `free_camera_error`: measured in the bake, in the scene's default look; null without a
    free camera, and if it could not be measured.
    """

    type: Literal["hello"] = "hello"
    session: str
    bake: str
    method: str
    axes: list[Literal["curve", "parameter", "light", "environment", "bounces", "camera"]]
    scene: str
    look: dict[str, Any]
    solo: list[str] | None
    revision: int
    resumed: bool
    focused_view: str
    visible_views: list[str]
    views: list[ViewInfo]
    materials: list[str]
    resume: str
    role: RoleName
    room: RoomInfo | None
    free_camera_error: FreeCameraError | None = None


class StatusMessage(Message):
    """server → client: something takes time; `progress` 0…1. A curve is precomputed for edits (`label` names it), or a
    term is shaded for the first time; "ready" ends it. Other work continues meanwhile.
    """

    type: Literal["status"] = "status"
    state: Literal["precomputing", "shading", "ready"]
    view: str
    label: str
    progress: float


class ProblemMessage(Message):
    """server → client: a message was rejected; the look is unchanged."""

    type: Literal["problem"] = "problem"
    revision: int | None
    problem: Problem


class InspectAnswer(Message):
    """server → client: one pixel; `bands` is the contribution of each band of the active curve, per channel.

    `position` and `normal`: of the surface that covers most of the pixel, world space; null for background.
    """

    type: Literal["inspect"] = "inspect"
    view: str
    x: int
    y: int
    material: str | None
    position: tuple[float, float, float] | None
    normal: tuple[float, float, float] | None
    radiance: tuple[float, float, float]
    curve: str | None
    bands: list[list[float]] | None


class PathAnswer(Message):
    """server → client: `length` of a path to its first surface, meters, with its material and unit normal; null if the
    path is free.

    `solid`: material of the closed surface that its last point is in, as inside a wall; null in rooms and in the open.
    """

    type: Literal["path"] = "path"
    id: Revision
    length: float | None
    material: str | None
    normal: tuple[float, float, float] | None
    solid: str | None


class CurveMessage(Message):
    """server → client: the active curve at this revision, band averages per channel, over 0…`max_degrees`."""

    type: Literal["curve"] = "curve"
    curve: str
    revision: int
    bands: list[list[float]]
    generated: list[list[float]]
    max_degrees: float = 90.0


class BakeMessage(Message):
    """server → client: another bake of the scene is running or ready; to use it, open a session and send the look."""

    type: Literal["bake"] = "bake"
    bake: str
    replaces: str
    state: str
    progress: float
    phase: Phase | None
    seconds_left: float | None


ServerMessage = (
    HelloMessage
    | StatusMessage
    | ProblemMessage
    | InspectAnswer
    | PathAnswer
    | CurveMessage
    | BakeMessage
    | DrainMessage
    | RoomMessage
    | RoomUpdate
    | CommentsMessage
    | PongMessage
)


class FrameTimes(Message):
    """Milliseconds spent on a frame: waiting, updating the image, encoding."""

    wait: float
    update: float
    encode: float


class ArrayInfo(Message):
    """An array of a payload or of GET /api/bakes/{id}/probes: number of texels, each of 1, 2 or 4 numbers."""

    name: str
    dtype: Literal["float32", "float16", "uint32", "int32"]
    shape: tuple[int, int]


class SceneUpdate(Message):
    """Shader constants of a look, besides arrays. `gain`: of the image; `environment_gain`, `background_gain`: of the
    prefiltered environment for lobes, and of the background, per channel. `environment_rotation`: added to u.
    `environment_mips`: first texel, height and width of each. `bright_lights`: bright environment lights, which lobes
    evaluate separately: direction, radiance, spread. `shows_direct`: direct light and the background are visible.
    `arrays`: those in the payload; all others are unchanged.
    """

    gain: tuple[float, float, float]
    environment_gain: tuple[float, float, float]
    background_gain: tuple[float, float, float]
    environment_rotation: float
    environment_mips: list[tuple[int, int, int]]
    bright_lights: list[tuple[float, float, float, float, float, float, float]]
    background: Literal["map", "blurred", "color", "transparent"]
    background_color: tuple[float, float, float]
    background_size: tuple[int, int]
    shows_direct: bool
    arrays: list[ArrayInfo]


class FrameHeader(Message):
    """Header of a binary frame. `room_revision`: of the last `RoomUpdate` that it shows. `camera_seq`: of the camera
    that it shows, null before the first one and for fixed cameras. `exact`: the client's whole image is exact;
    `fidelity`: of its visible region. `complete`: every term is shown. `free_camera_error`: with the first exact frame
    after the camera stopped: error of the image shown while it moved, without corrections. `traces_lobes`: a free
    camera traces rays along narrow lobes, which a browser cannot draw. `scene_update`: only for kind "scene_update".
    """

    frame: int
    revision: int
    room_revision: int = 0
    view: str
    width: int
    height: int
    tiles: list[tuple[int, int, int, int]]
    format: Literal["rgb9e5", "jpeg", "png", "f32", "r8", "arrays"]
    exact: bool
    fidelity: Fidelity
    complete: bool
    kind: Literal["picture", "highlight", "scene_update"]
    alpha: bool = False
    camera_seq: int | None = None
    free_camera_error: FreeCameraError | None = None
    traces_lobes: bool = False
    scene_update: SceneUpdate | None = None
    ms: FrameTimes
