"""Bodies of batch renders."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from relume.look.interpolate import InterpolationMode
from relume.output.exr.layers import Layering
from relume_server.schemas.base import Body, Id, JobState, Name
from relume_server.schemas.cameras import CameraFrame

Side = Annotated[int, Field(ge=1, le=16384)]
ImageFormat = Literal["exr", "png", "webp"]
RenderFormat = Literal["exr", "png", "webp", "mp4"]
MAX_LOOKS = 1000
MAX_FRAMES = 3600
MAX_LISTED_FRAMES = 600  # frames whose looks are told at once
MAX_LISTED_BYTES = 16 << 20
Frames = Annotated[int, Field(ge=1, le=MAX_FRAMES)]
TurntableSubject = Literal["camera", "object", "environment"]
Metres = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class Turntable(Body):
    """Once around an upright line, in so many frames; `start_camera`: the first of them, by default where the view
    begins.

    `pivot`: a place on the line, metres; by default in the middle of the first picture, as deep as what it shows.
    `rotate`: the `camera`; or, before a camera that stays, the `object`, under an environment and lights that stay,
    too; or the `environment` alone, which needs no bake with a free camera.
    """

    turntable: Frames
    start_camera: CameraFrame | None = None
    pivot: Annotated[list[Metres], Field(min_length=3, max_length=3)] | None = None
    rotate: TurntableSubject = "camera"


class CameraPath(Body):
    """From camera to camera, at even shares of the frames; one frame each where no number of frames is given."""

    cameras: Annotated[list[CameraFrame], Field(min_length=1, max_length=MAX_LOOKS)]


def _path_kind(path: Any) -> str:
    """Which way is meant, so that nobody is told what the other lacks."""
    is_round = isinstance(path, Turntable) or (isinstance(path, dict) and "turntable" in path)
    return "turntable" if is_round else "cameras"


Path = Annotated[
    Annotated[Turntable, Tag("turntable")] | Annotated[CameraPath, Tag("cameras")],
    Discriminator(_path_kind),
]


class Keyframes(Body):
    """Looks, perhaps partial, of a bake. With `frames` they are keyframes at even shares of so many, and what is
    between goes from one to the next. `interpolation`: from parameter to parameter, or across the material map (GET
    /api/materials/map) where both are of its kind."""

    bake: Id
    looks: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=MAX_LOOKS)]
    frames: Frames | None = None
    interpolation: InterpolationMode = "parameters"

    @property
    def num_frames(self) -> int:
        """How many pictures come of it."""
        return len(self.looks) if self.frames is None else self.frames


class Animation(Keyframes):
    """Keyframes that may be seen from elsewhere in each frame: `path`, which a bake whose eye moves can follow."""

    path: Path | None = None

    @property
    def num_frames(self) -> int:
        """How many pictures come of it."""
        if isinstance(self.path, Turntable):
            return self.path.turntable
        if self.frames is not None:
            return self.frames
        return max(len(self.looks), len(self.path.cameras) if self.path is not None else 1)


class LooksRequest(Animation):
    """What each frame of an animation shows; `view`: of which `path` is a way."""

    view: Name | None = None


class LooksBody(Body):
    """The complete look of each frame, and from where it is seen; null where no `path` was given."""

    looks: list[dict[str, Any]]
    cameras: list[CameraFrame] | None


class RenderRequest(Animation):
    """A batch of exact pictures; looks may be partial.

    `size`: at most the baked one, which is the default; where the eye moves, any. `name`: what downloads are called; by
    default the scene and the view. Of EXR alone: `layers` beside the picture, one for each light and each kind of light
    path, or "light_groups", direct and reflected light of each light, together the picture; `precision` of the values;
    and `color_space`, a linear one of the server's OpenColorIO config (GET /api/color), else linear Rec. 709.

    Of an animation: `path` and `frames`, see POST /api/renders/looks. `format` "mp4" makes a video of them, `fps`
    frames a second. `quality`: "interactive" renders frames of a free camera as they look while it moves, a hundred
    times sooner.
    """

    view: Name
    format: RenderFormat
    size: tuple[Side, Side] | None = None
    name: Name | None = None
    layers: Layering = False
    precision: Literal["half", "float"] = "half"
    color_space: Name | None = None
    fps: Annotated[int, Field(ge=1, le=120)] = 25
    quality: Literal["exact", "interactive"] = "exact"

    @property
    def picture_format(self) -> ImageFormat:
        """Of a single frame."""
        return "png" if self.format == "mp4" else self.format


class RenderBody(Body):
    """A batch; `completed` of `total` frames are finished, `progress` 0…1 counts what is done of the next one too.

    `seconds_left`: null where it does not run or nothing was measured yet. `user` asked for it; "" where nobody logs
    in. `created`, `started` and `ended` are times; null: not yet.
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
