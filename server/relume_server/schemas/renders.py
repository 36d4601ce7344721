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
RenderFormat = Literal["exr", "png", "webp", "mp4"]
MAX_LOOKS = 1000
MAX_FRAMES = 3600
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


class RenderRequest(Animation):
    """A batch of exact images; looks may be partial.

    `size`: at most the baked one, the default; any for a free camera. `name`: of downloads; default: scene and view.
    Only for EXR: `layers`, true for one per light and per light path, or "light_groups" for direct and indirect light
    of each light, which add up to the image; `aovs`: depth, position, normals, texture coordinates, albedo, emission,
    and Cryptomattes of objects and materials; `precision` of the values; and `color_space`, a linear one of the
    server's OpenColorIO config (GET /api/color), by default linear Rec. 709.

    For animations: `path` and `frames`, see POST /api/renders/looks. `format` "mp4" makes a video with `fps` frames per
    second. `quality`: "interactive" renders a free camera as it looks while moving, about a hundred times faster.
    """

    view: Name
    format: RenderFormat
    size: tuple[Side, Side] | None = None
    name: Name | None = None
    layers: Layering = False
    aovs: bool = False
    precision: Literal["half", "float"] = "half"
    color_space: Name | None = None
    fps: Annotated[int, Field(ge=1, le=120)] = 25
    quality: Literal["exact", "interactive"] = "exact"

    @property
    def picture_format(self) -> ImageFormat:
        """Image format of a single frame."""
        return "png" if self.format == "mp4" else self.format


RENDER_PLACEHOLDER = RenderRequest(bake="0" * 16, view="unknown", looks=[{}], format="png")
"""Stands for requests in the database that cannot be read."""


class RenderBody(Body):
    """A batch; `completed` of `total` frames are finished, `progress` 0…1 includes part of the current one.

    `seconds_left`: null if it is not running or nothing has been measured yet. `user`: who requested it; "" without
    login. `created`, `started` and `ended` are times; null: not yet.
    """

    id: str
    name: str | None
    user: str
    bake: str
    view: str
    format: RenderFormat
    size: tuple[int, int] | None
    state: JobState
    created: str
    started: str | None
    ended: str | None
    completed: int
    total: int
    progress: float
    seconds_left: float | None
    problem: str | None
