"""Every message of a live session (subprotocol relume.v1), typed once; the editor's TypeScript is generated from here.

Text messages are JSON, at most `MAX_MESSAGE_BYTES`. A binary message is one frame: uint32 little-endian header length,
JSON header (`FrameHeader`), payload. The payload holds the header's tiles one after another, row-major, top row first:
"rgb9e5" 4 bytes a pixel, "f32" 12 bytes a pixel, "jpeg" one image of the whole picture, perhaps of fewer pixels, "r8"
one byte a pixel (frames of kind "brush": 0…255 stands for 0…1). Where the header says `alpha`, a byte for each pixel of
the same tiles follows all that: how much it hides of what is put behind it, which its light has been multiplied by
already. A frame of kind "tables" has no tiles: its payload is the arrays that `tables` names, little-endian, one after
another.
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

SUBPROTOCOL = "relume.v1"
MAX_MESSAGE_BYTES = 64 * 1024
MAX_FRAMES_IN_FLIGHT = 2
MAX_VIEWS_SHOWN = 4
MAX_EYE_PIXELS = 1920 * 1200
# of GET /api/bakes/{id}/surface/…, kept for ever: clients name it, lest what an earlier release gave be taken for it
SURFACE_LAYOUT = 3

Sources = Annotated[list[Name], Field(min_length=1, max_length=MAX_LIGHTS + 1)]
Degrees = Annotated[float, Field(ge=0, le=90, allow_inf_nan=False)]
Pixel = Annotated[int, Field(ge=0, le=65535)]
Extent = Annotated[int, Field(ge=1, le=65535)]
Coordinate = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]


class EditMessage(Message):
    """client → server: change the look; `revision` must be newer than the last. `hand` is what the hand is on: a curve,
    or what a touch may name as `parameter`, in the look after the edit; null for all other edits. `solo` names sources
    of light, local lights and "environment", that alone are shown from now on, without being part of the look; null:
    all. Left out, it stays as it was. An edit that says `solo` may have an empty patch."""

    type: Literal["edit"]
    revision: Revision
    patch: Annotated[list[PatchOperation], Field(max_length=MAX_OPERATIONS)]
    hand: Pointer | None = None
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
    names: Annotated[list[Name], Field(min_length=1, max_length=MAX_VIEWS_SHOWN)]


class FocusMessage(Message):
    """client → server: the pointer is in this view, one of those that are shown: its frames and freezes go first."""

    type: Literal["focus"]
    view: Name


class RegionMessage(Message):
    """client → server: of a view whose eye is "baked" this region is on the screen: x, y, width, height in pixels of
    its picture. It is exact before the rest, frames of what is on its way bring its tiles alone, and `fidelity` is that
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

    type: Literal["stream"]
    format: Literal["hdr", "jpeg", "auto"]
    quality: Annotated[int, Field(ge=1, le=95)] = 80


class InspectMessage(Message):
    """client → server: what makes up this pixel? Of a shown view, the focused one by itself; see `InspectAnswer`."""

    type: Literal["probe"]
    view: Name | None = None
    x: Pixel
    y: Pixel


class HighlightMessage(Message):
    """client → server: which pixels does this stretch of a curve light? Each shown view answers by a frame "brush"."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_by_name=True, validate_by_alias=True)

    type: Literal["brush"]
    curve: Pointer
    from_degrees: Degrees = Field(alias="from")
    to_degrees: Degrees = Field(alias="to")


class PrepareMessage(Message):
    """client → server: one of two: the user opened this `curve`: freeze it ahead and send its `CurveMessage` from now
    on; or has in hand what moves this `parameter`, which may also be a light (/lights/NAME) or a field of the
    environment: prepare for it, the open curve stays open."""

    type: Literal["touch"]
    curve: Pointer | None = None
    parameter: Pointer | None = None

    @model_validator(mode="after")
    def _has_one_target(self) -> PrepareMessage:
        if (self.curve is None) == (self.parameter is None):
            raise ValueError("a touch names a curve or a parameter, one of them")
        return self


class CameraMessage(Message):
    """client → server: see a view whose eye is "free" from here, in a picture of this size; the latest wins, and frames
    name the `eye` that they show. `to_world`, by row, and `yfov`: as in `CameraInfo`. `hand` is what the hand is on, as
    in an edit; nothing is prepared for it. `rest`: "exact", an exact picture from there follows when the eye rests, and
    edits go on in it; "stay", none does."""

    type: Literal["eye"]
    view: Name
    eye: Revision
    to_world: Annotated[list[Coordinate], Field(min_length=16, max_length=16)]
    yfov: Annotated[float, Field(gt=0, lt=math.pi, allow_inf_nan=False)]
    size: tuple[Pixel, Pixel]
    hand: Pointer | None = None
    rest: Literal["exact", "stay"] = "exact"


class RendererMessage(Message):
    """client → server: who finds the pixels of views whose eye is "free" while they move. "browser": from now on frames
    of kind "tables" bring what a shader needs, beside what GET /api/bakes/{id}/surface gave once, each part again where
    it has changed; no frame comes for an eye alone. Exact pictures come as ever."""

    type: Literal["evaluate"]
    by: Literal["browser", "server"]


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
    """A view, its size in pixels and its camera; `eye`: seen from where it was baked alone, or from anywhere. Then
    `bounds` are the lowest and the highest corner of what there is to see, metres."""

    name: str
    width: int
    height: int
    camera: CameraInfo
    eye: Literal["baked", "free"]
    bounds: tuple[list[float], list[float]] | None = None


class FreeCameraError(Message):
    """How far pictures are from the exact ones while an eye moves, measured in the bake: relative RMS over the surfaces
    that a few eyes see, in the scene's own look."""

    value: float
    standard_error: float


class HelloMessage(Message):
    """server → client: first message. `revision` and `solo` are the last ones of a resumed session, else 0 and null.

    `shown` are the views that frames come of, `view` is the focused one; `views` are all that were baked. `method`: the
    light of the bake; `axes`: what can be changed in its pictures. `role`: who may only `view` sends no edits. `room`:
    where others share the look, null for a session of one. `moving_error`: null where no eye moves, of bakes of
    before, and where it could not be measured.
    """

    type: Literal["hello"] = "hello"
    session: str
    bake: str
    method: str
    axes: list[Literal["curve", "parameter", "light", "environment", "bounces", "eye"]]
    scene: str
    look: dict[str, Any]
    solo: list[str] | None
    revision: int
    resumed: bool
    view: str
    shown: list[str]
    views: list[ViewInfo]
    materials: list[str]
    resume: str
    role: RoleName
    room: RoomInfo | None
    moving_error: FreeCameraError | None = None


class StatusMessage(Message):
    """server → client: something takes time; `progress` 0…1. A curve is frozen for its edits, or a term is shaded
    because the picture has no image of it yet; "ready": that has ended. What does not wait for it goes on meanwhile."""

    type: Literal["status"] = "status"
    state: Literal["freezing", "shading", "ready"]
    view: str
    what: str
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

    type: Literal["probe"] = "probe"
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
    """An array of a payload or of GET /api/bakes/{id}/surface: so many texels of 1, 2 or 4 numbers."""

    name: str
    dtype: Literal["float32", "float16", "uint32", "int32"]
    shape: tuple[int, int]


class SceneUpdate(Message):
    """What a shader needs for a look besides arrays. `gain`: of the picture; `sky_gain`, `background_gain`: of what
    lobes see of the sky, and of the sky itself, per channel. `sky_turn`: added to u. `sky_levels`: first texel, height
    and width of each. `lamps`: of the sky, that lobes show apart: direction, light, spread. `is_direct`: light that
    comes straight is shown, and with it the background. `arrays` are those of the payload; those that are not named
    are as they were."""

    gain: tuple[float, float, float]
    sky_gain: tuple[float, float, float]
    background_gain: tuple[float, float, float]
    sky_turn: float
    sky_levels: list[tuple[int, int, int]]
    lamps: list[tuple[float, float, float, float, float, float, float]]
    background: Literal["map", "blurred", "color", "transparent"]
    background_color: tuple[float, float, float]
    background_size: tuple[int, int]
    is_direct: bool
    arrays: list[ArrayInfo]


class FrameHeader(Message):
    """Header of a binary frame. `shared`: as in the last `RoomUpdate` whose look it shows. `eye`: number of the eye
    that it shows, null before the first and of fixed views. `was_off`: of the first exact frame where an eye rests, how
    far the moving picture was from it, relative RMS. `tables`: of kind "tables" alone."""

    frame: int
    revision: int
    shared: int = 0
    view: str
    width: int
    height: int
    tiles: list[tuple[int, int, int, int]]
    format: Literal["rgb9e5", "jpeg", "f32", "r8", "arrays"]
    exact: bool
    fidelity: FidelityLabel
    complete: bool
    kind: Literal["picture", "brush", "tables"]
    alpha: bool = False
    eye: int | None = None
    was_off: float | None = None
    tables: SceneUpdate | None = None
    ms: FrameTimes
