"""Bodies of batch renders."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from relume.look.interpolate import InterpolationMode
from relume.output.exr.layers import Layering
from relume.scene.validate import MAX_METERS
from relume_server.schemas.base import Body, Id, Name
from relume_server.schemas.cameras import CameraFrame
from relume_worker.job_state import JobState

Side = Annotated[int, Field(ge=1, le=16384)]
ImageFormat = Literal["exr", "png", "webp"]
RenderFormat = Literal["exr", "png", "webp", "mp4", "contact_sheet"]
MAX_LOOKS = 1000
MAX_FRAMES = 3600
MAX_VIEWS = 64  # of one render
MAX_FRAME_NUMBER = 10**8
MAX_PRIORITY = 10
MAX_WEBHOOK = 2048
MAX_LISTED_FRAMES = 600  # frames per POST /api/renders/looks
MAX_LISTED_BYTES = 16 << 20
Duration = Annotated[float, Field(ge=1e-3, le=1e6, allow_inf_nan=False)]
Frames = Annotated[int, Field(ge=1, le=MAX_FRAMES)]
TurntableSubject = Literal["camera", "object", "environment"]
Metres = Annotated[float, Field(ge=-MAX_METERS, le=MAX_METERS, allow_inf_nan=False)]


class Turntable(Body):
    """One revolution about a vertical axis, in so many frames; `start_camera`: of the first frame, by default the
    view's.

    `pivot`: a point on the axis, meters; by default the center of the first image, at the depth of its surface.
    `rotate`: the `camera`; or the `object`, with fixed camera, environment and lights; or the `environment` alone,
    which needs no free camera.
    """

    turntable: Frames
    start_camera: CameraFrame | None = None
    pivot: Annotated[list[Metres], Field(min_length=3, max_length=3)] | None = None
    rotate: TurntableSubject = "camera"


class CameraPath(Body):
    """Interpolate cameras, spaced evenly over the frames, or as the looks if there are equally many; one frame each
    if no number of frames is given.
    """

    cameras: Annotated[list[CameraFrame], Field(min_length=1, max_length=MAX_LOOKS)]


def _path_kind(path: Any) -> str:
    """Select the kind of path, so that errors mention only that kind."""
    is_round = isinstance(path, Turntable) or (isinstance(path, dict) and "turntable" in path)
    return "turntable" if is_round else "cameras"


Path = Annotated[
    Annotated[Turntable, Tag("turntable")] | Annotated[CameraPath, Tag("cameras")],
    Discriminator(_path_kind),
]


class Keyframes(Body):
    """Looks of a bake, perhaps partial. With `frames` they are keyframes, spaced evenly or by `durations`, relative
    times from each to the next, and the looks between are interpolated. `interpolation`: by parameters, or along the
    material map (GET /api/materials/map) if both materials are of its model: "map" is that of Ngan's fits, "map_low"
    that of Löw's.
    """

    bake: Id
    looks: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=MAX_LOOKS)]
    frames: Frames | None = None
    durations: Annotated[list[Duration], Field(max_length=MAX_LOOKS - 1)] | None = None
    interpolation: InterpolationMode = "parameters"

    @property
    def num_frames(self) -> int:
        """Number of images."""
        return len(self.looks) if self.frames is None else self.frames


class Animation(Keyframes):
    """Keyframes with an optional camera `path`, which needs a bake with a free camera."""

    path: Path | None = None

    @property
    def num_frames(self) -> int:
        """Number of images."""
        if isinstance(self.path, Turntable):
            return self.path.turntable
        if self.frames is not None:
            return self.frames
        return max(len(self.looks), len(self.path.cameras) if self.path is not None else 1)


class LooksRequest(Animation):
    """Request the look of each frame of an animation; `view`: of the `path`."""

    view: Name | None = None


class LooksBody(Body):
    """Complete look and camera of each frame; cameras are null without a `path`.

    `crosses`: material of the first surface that the camera's path crosses, null if there is none.
    """

    looks: list[dict[str, Any]]
    cameras: list[CameraFrame] | None
    crosses: str | None


class BakeView(Body):
    """A view of a bake; `bake` null: that of the request."""

    view: Name
    bake: Id | None = None


class RenderRequest(Animation):
    """A batch of exact images; looks may be partial, and light mixes.

    `looks` are documents, `look_names` their names, and `saved_looks` names of saved looks, after them. `view` is the
    view of `bake`; `views`, instead, are several, also of other bakes: all looks are rendered in each. `size`: at most
    the baked one, the default; any for a free camera. `name`: of downloads; default: scene and view.

    `file_name`: name of each image with fields, such as "{scene}_{view}_{look}.{frame:04}.exr"; fields are `scene`,
    `bake`, `view`, `look` and `frame`, a number with up to 9 digits. Frames, or looks without `frames` and `path`, are
    numbered from `start_frame`; of an animation only each `frame_step`-th is rendered, and has its number.
    `saved_views`: render each saved look in the view saved with it, and the others in `view`. `rebake`: if a bake with
    fixed cameras has another size than `size`, bake its views with this size first. `dry_run`: check everything, queue
    nothing, and return names and cost.
    `priority`: among renders of the same user, higher ones first. `webhook`: address that gets a signed message when
    the render has ended, see docs/operations.md.

    Only for EXR: `layers`, true for one per light and per light path, or "light_groups" for direct and indirect light
    of each light, which add up to the image; `aovs`: depth, position, normals, texture coordinates, albedo, emission,
    and Cryptomattes of objects and materials; `precision` of the values; and `color_space`, a linear one of the
    server's OpenColorIO config (GET /api/color), by default linear Rec. 709.

    For animations: `path` and `frames`, see POST /api/renders/looks. `format` "mp4" makes a video with `fps` frames per
    second, "contact_sheet" one PNG of all images with their names. `quality`: "interactive" renders a free camera as it
    looks while moving, about a hundred times faster.
    """

    looks: list[dict[str, Any]] = Field(default_factory=list, max_length=MAX_LOOKS)
    look_names: list[Name] = Field(default_factory=list, max_length=MAX_LOOKS)
    saved_looks: list[Name] = Field(default_factory=list, max_length=MAX_LOOKS)
    view: Name | None = None
    views: list[BakeView] = Field(default_factory=list, max_length=MAX_VIEWS)
    format: RenderFormat
    size: tuple[Side, Side] | None = None
    saved_views: bool = False
    rebake: bool = False
    dry_run: bool = False
    name: Name | None = None
    file_name: Name | None = None
    start_frame: Annotated[int, Field(ge=0, le=MAX_FRAME_NUMBER)] = 0
    frame_step: Annotated[int, Field(ge=1, le=MAX_FRAMES)] = 1
    priority: Annotated[int, Field(ge=-MAX_PRIORITY, le=MAX_PRIORITY)] = 0
    webhook: Annotated[str, Field(max_length=MAX_WEBHOOK)] | None = None
    layers: Layering = False
    aovs: bool = False
    precision: Literal["half", "float"] = "half"
    color_space: Name | None = None
    fps: Annotated[int, Field(ge=1, le=120)] = 25
    quality: Literal["exact", "interactive"] = "exact"

    @property
    def picture_format(self) -> ImageFormat:
        """Image format of a single frame."""
        return "png" if self.format == "mp4" or self.format == "contact_sheet" else self.format

    @property
    def is_animation(self) -> bool:
        """True if images are frames of one sequence, and not one for each look."""
        return self.frames is not None or self.path is not None

    @property
    def frame_indices(self) -> range:
        """Frames that are rendered in each view."""
        return range(0, self.num_frames, self.frame_step)

    @property
    def bake_views(self) -> list[tuple[str, str]]:
        """Bake and view of each group of images."""
        return [(each.bake or self.bake, each.view) for each in self.views] or [(self.bake, self.view or "")]

    @property
    def num_images(self) -> int:
        """Number of images of all views."""
        return len(self.bake_views) * len(self.frame_indices)

    def image(self, index: int) -> tuple[str, str, int]:
        """Bake, view and frame of an image; all frames of a view follow each other."""
        view, frame = divmod(index, len(self.frame_indices))
        return *self.bake_views[view], self.frame_indices[frame]


class QueuedRender(RenderRequest):
    """A request whose looks are all documents, as it is stored.

    `look_views`: the view of each look, if they have their own; the cameras are those of `path`.
    `file_names`: of all images. `labels`: of all images of a contact sheet. `warnings`: a sentence for each thing that
    is not as in the looks.
    """

    look_views: list[Name] = Field(default_factory=list)
    file_names: list[str] = Field(default_factory=list)
    labels: list[str] = Field(default_factory=list)
    warnings: list[str] = Field(default_factory=list)

    @property
    def bake_views(self) -> list[tuple[str, str]]:
        """Bake and view of each group of images, or of the looks."""
        return [(self.bake, view) for view in dict.fromkeys(self.look_views)] or super().bake_views

    @property
    def num_images(self) -> int:
        """Number of images of all views."""
        return len(self.look_views) or super().num_images

    def image(self, index: int) -> tuple[str, str, int]:
        """Bake, view and frame of an image."""
        return (self.bake, self.look_views[index], index) if self.look_views else super().image(index)


RENDER_PLACEHOLDER = QueuedRender(bake="0" * 16, view="unknown", looks=[{}], format="png")
"""Stands for requests in the database that cannot be read."""


class RenderBody(Body):
    """A batch; `completed` of `total` frames are finished, `progress` 0…1 includes part of the current one.

    `baking`: progress 0…1 of a bake that it waits for; null: none. `seconds_left`: null if it is not running or nothing
    has been measured yet. `user`: who requested it; "" without login. `view`: null if there are several `views`.
    `warnings`: a sentence for each part of a light mix that a scene does not have. `created`, `started` and `ended` are
    times; null: not yet.
    """

    id: str
    name: str | None
    user: str
    bake: str
    view: str | None
    views: list[BakeView]
    format: RenderFormat
    size: tuple[int, int] | None
    priority: int
    warnings: list[str]
    state: JobState
    created: str
    started: str | None
    ended: str | None
    completed: int
    total: int
    progress: float
    seconds_left: float | None
    problem: str | None
    baking: float | None
