"""Every message of a live session (subprotocol relume.v2), typed once; the editor's TypeScript is generated from here.

Text messages are JSON, at most `MAX_MESSAGE_BYTES`. A binary message is one frame: uint32 little-endian header length,
JSON header (`FrameHeader`), payload. The payload holds the header's tiles one after another, row-major, top row first:
"rgb9e5" 4 bytes a pixel, "f32" 12 bytes a pixel, "jpeg" one image of the whole picture, perhaps of fewer pixels, "r8"
one byte a pixel (frames of kind "highlight": 0…255 stands for 0…1). Where the header says `alpha`, a byte for each
pixel of the same tiles follows all that: how much it hides of what is put behind it, which its light has been
multiplied by already. A frame of kind "scene_update" has no tiles: its payload is the arrays that `scene_update` names,
little-endian, one after another.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from relume.live.fixed_camera.fidelity import FidelityLabel
from relume.look.patch import MAX_OPERATIONS
from relume.scene.validate import MAX_LIGHTS
from relume_server.schemas.connection import DrainMessage, OpenMessage, PingMessage, PongMessage
from relume_server.schemas.message import Message, Name, PatchOperation, Pointer, Revision, RoleName
from relume_server.schemas.rooms import CommentsMessage, PresenceMessage, RoomInfo, RoomMessage, RoomUpdate
from relume_worker.status import Phase

SUBPROTOCOL = "relume.v2"
MAX_MESSAGE_BYTES = 64 * 1024
MAX_FRAMES_IN_FLIGHT = 2
MAX_VISIBLE_VIEWS = 4
MAX_CAMERA_PIXELS = 1920 * 1200
# of GET /api/bakes/{id}/probes/…, kept for ever: clients name it, lest what an earlier release gave be taken for it
PROBES_LAYOUT = 3

Sources = Annotated[list[Name], Field(min_length=1, max_length=MAX_LIGHTS + 1)]
Degrees = Annotated[float, Field(ge=0, le=90, allow_inf_nan=False)]
Pixel = Annotated[int, Field(ge=0, le=65535)]
Extent = Annotated[int, Field(ge=1, le=65535)]
Coordinate = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]


class EditMessage(Message):
    """client → server: change the look; `revision` must be newer than the last. `active_control` is what is being
    dragged: a curve, or what `PrepareMessage` may name as `parameter`, in the look after the edit; null for all other
    edits. `solo` names sources of light, local lights and "environment", that alone are shown from now on, without
    being part of the look; null: all. Left out, it stays as it was. An edit that says `solo` may have an empty
    patch."""

    type: Literal["edit"]
    revision: Revision
    patch: Annotated[list[PatchOperation], Field(max_length=MAX_OPERATIONS)]
    active_control: Pointer | None = None
    solo: Sources | None = None

    @property
    def changes_solo(self) -> bool:
        """Whether it changes what is alone."""
        return "solo" in self.model_fields_set

    @model_validator(mode="after")
    def _is_edit(self) -> EditMessage:
        if not self.patch and not self.changes_solo:
            raise ValueError("an edit has a patch of one operation at least, or says what is solo")
        return self


class ViewMessage(Message):
    """client → server: show this view alone. `size` is the space that the client has, in pixels: JPEGs are scaled down
    to fit into it, until views are shown otherwise; all other frames come in the baked size."""

    type: Literal["view"]
    name: Name
    size: tuple[Pixel, Pixel] | None = None


class ViewsMessage(Message):
    """client → server: show these views side by side; every edit changes all of them."""

    type: Literal["views"]
    names: Annotated[list[Name], Field(min_length=1, max_length=MAX_VISIBLE_VIEWS)]


class FocusMessage(Message):
    """client → server: the pointer is in this view, one of those that are shown: its frames and freezes go first."""

    type: Literal["focus"]
    view: Name


class RegionMessage(Message):
    """client → server: of a view whose camera is "fixed" this region is on the screen: x, y, width, height in pixels of
    its picture. It is exact before all else, frames of what is on its way bring its tiles alone, and `fidelity` is that
    of what is in it. null: all of the picture, as it is before anything is said."""

    type: Literal["region"]
    view: Name
    rect: tuple[Pixel, Pixel, Extent, Extent] | None


class AckMessage(Message):
    """client → server: this frame was received and shown."""

    type: Literal["ack"]
    frame: Annotated[int, Field(ge=0, le=2**53)]


class EncodingMessage(Message):
    """client → server: how pictures are sent. "auto": HDR, JPEG while moving where the link is too slow for it."""

    type: Literal["encoding"]
    format: Literal["hdr", "jpeg", "auto"]
    quality: Annotated[int, Field(ge=1, le=95)] = 80


class InspectMessage(Message):
    """client → server: what makes up this pixel? Of a shown view, the focused one by itself; see `InspectAnswer`."""

    type: Literal["inspect"]
    view: Name | None = None
    x: Pixel
    y: Pixel


class HighlightMessage(Message):
    """client → server: which pixels does this stretch of a curve light? Each shown view answers by a frame
    "highlight"."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_by_name=True, validate_by_alias=True)

    type: Literal["highlight_curve_range"]
    curve: Pointer
    from_degrees: Degrees = Field(alias="from")
    to_degrees: Degrees = Field(alias="to")


class PrepareMessage(Message):
    """client → server: one of two: the user opened this `curve`: freeze it ahead and send its `CurveMessage` from now
    on; or has in hand what moves this `parameter`, which may also be a light (/lights/NAME) or a field of the
    environment: prepare for it, the open curve stays open."""

    type: Literal["prepare"]
    curve: Pointer | None = None
    parameter: Pointer | None = None

    @model_validator(mode="after")
    def _has_one_target(self) -> PrepareMessage:
        if (self.curve is None) == (self.parameter is None):
            raise ValueError("a prepare message names either a curve or a parameter")
        return self


class CameraMessage(Message):
    """client → server: see a view whose camera is "free" from here, in a picture of this size; the latest wins, and
    frames name its `seq` as `camera_seq`. `to_world`, by row, and `yfov`: as in `CameraInfo`. `active_control`: as in
    an edit; nothing is prepared for it. `refine`: "exact", an exact picture from there follows when the camera stops,
    and edits go on in it; "none", none does."""

    type: Literal["camera"]
    view: Name
    seq: Revision
    to_world: Annotated[list[Coordinate], Field(min_length=16, max_length=16)]
    yfov: Annotated[float, Field(gt=0, lt=math.pi, allow_inf_nan=False)]
    size: tuple[Pixel, Pixel]
    active_control: Pointer | None = None
    refine: Literal["exact", "none"] = "exact"


class RendererMessage(Message):
    """client → server: who renders views whose camera is "free" while they move. "client": from now on frames
    of kind "scene_update" bring what a shader needs, beside what GET /api/bakes/{id}/probes gave once, each part again
    where it has changed; no frame comes for a camera alone. Exact pictures come as ever."""

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
    """RFC 9457. `type` names the kind, `detail` says what happened and what to do."""

    model_config = ConfigDict(extra="allow", frozen=True)

    type: str
    title: str
    status: int
    detail: str


class CameraInfo(Message):
    """Looks along its -Z. `to_world`: camera to world, 4 × 4 by row, rigid, metres. `yfov`: vertical, radians."""

    to_world: list[float]
    yfov: float


class ViewInfo(Message):
    """A view, its size in pixels and its camera; `camera_mode`: seen from where it was baked alone, or from anywhere.
    Then `bounds` are the lowest and the highest corner of what there is to see, metres."""

    name: str
    width: int
    height: int
    camera: CameraInfo
    camera_mode: Literal["fixed", "free"]
    bounds: tuple[list[float], list[float]] | None = None


class FreeCameraError(Message):
    """How far pictures are from the exact ones while an eye moves, measured in the bake: relative RMS over the surfaces
    that a few eyes see, in the scene's own look."""

    value: float
    standard_error: float


class HelloMessage(Message):
    """server → client: first message. `revision` and `solo` are the last ones of a resumed session, else 0 and null.

    `visible_views` are the views that frames come of, `focused_view` is one of them; `views` are all that were baked.
    `method`: the light of the bake; `axes`: what can be changed in its pictures. `role`: who may only `view` sends no
    edits. `room`: where others share the look, null for a session of one. `free_camera_error`: null where no camera is
    free, and where it could not be measured.
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
    """server → client: something takes time; `progress` 0…1. A curve is precomputed for its edits (`label` names it),
    or a term is shaded because the picture has no image of it yet; "ready": that has ended. What does not wait for it
    goes on meanwhile."""

    type: Literal["status"] = "status"
    state: Literal["precomputing", "shading", "ready"]
    view: str
    label: str
    progress: float


class ProblemMessage(Message):
    """server → client: a message was refused; the look stays as it was."""

    type: Literal["problem"] = "problem"
    revision: int | None
    problem: Problem


class InspectAnswer(Message):
    """server → client: one pixel; `bands` is each band's contribution of the active curve, per channel.

    `position` and `normal` are of the surface that covers most of it, world space; null for background.
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


class CurveMessage(Message):
    """server → client: the touched curve at this revision, band averages per channel, over 0…`max_degrees`."""

    type: Literal["curve"] = "curve"
    curve: str
    revision: int
    bands: list[list[float]]
    generated: list[list[float]]
    max_degrees: float = 90.0


class BakeMessage(Message):
    """server → client: another bake of the same scene goes on or is ready; open a session on it and send the look."""

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
    | CurveMessage
    | BakeMessage
    | DrainMessage
    | RoomMessage
    | RoomUpdate
    | CommentsMessage
    | PongMessage
)


class FrameTimes(Message):
    """Milliseconds spent on a frame: edit waiting, updating the picture, encoding."""

    wait: float
    update: float
    encode: float


class ArrayInfo(Message):
    """An array of a payload or of GET /api/bakes/{id}/probes: so many texels of 1, 2 or 4 numbers."""

    name: str
    dtype: Literal["float32", "float16", "uint32", "int32"]
    shape: tuple[int, int]


class SceneUpdate(Message):
    """What a shader needs for a look besides arrays. `gain`: of the picture; `environment_gain`, `background_gain`: of
    the prefiltered environment that lobes look up, and of the background, per channel. `environment_rotation`: added to
    u. `environment_mips`: first texel, height and width of each. `bright_lights`: of the environment, which lobes
    evaluate separately: direction, radiance, spread. `shows_direct`: direct light is shown, and with it the background.
    `arrays` are those of the payload; those that are not named are as they were."""

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
    """Header of a binary frame. `room_revision`: of the last `RoomUpdate` whose look it shows. `camera_seq`:
    of the camera that it shows, null before the first and of fixed views. `exact`: all that the client has of the
    picture is; `fidelity`: of what is in its region. `complete`: something of every term is shown. `previous_error`: of
    the first exact frame after the camera stopped, how far the approximate picture was from it, relative RMS.
    `scene_update`: of kind "scene_update" alone."""

    frame: int
    revision: int
    room_revision: int = 0
    view: str
    width: int
    height: int
    tiles: list[tuple[int, int, int, int]]
    format: Literal["rgb9e5", "jpeg", "f32", "r8", "arrays"]
    exact: bool
    fidelity: FidelityLabel
    complete: bool
    kind: Literal["picture", "highlight", "scene_update"]
    alpha: bool = False
    camera_seq: int | None = None
    previous_error: float | None = None
    scene_update: SceneUpdate | None = None
    ms: FrameTimes
