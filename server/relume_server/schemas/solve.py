"""Bodies of POST /api/solve."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Base64Bytes, Field

from relume.inverse_lighting.painting import StrokeKind
from relume_server.schemas.base import Body, Id, Name
from relume_server.schemas.cameras import CameraFrame
from relume_server.schemas.message import PatchOperation
from relume_server.schemas.renders import Side

MAX_STROKES = 64
MAX_STROKE_POINTS = 2048
MAX_LOCKED = 1024
MAX_MATERIALS = 32
Pointer = Annotated[str, Field(max_length=1024)]
Pixels = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
Stops = Annotated[float, Field(ge=0.0, le=10.0, allow_inf_nan=False)]
Component = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]


class StrokeBody(Body):
    """A stroke of a brush over the image: `brighter` or `darker` by `stops`; in a `color` (linear Rec. 709) at equal
    luminance; or as the `reference` picture there.

    `points`: a line in pixels, from the left and from the top of the image, with a brush of `radius` pixels. `mask`:
    instead, a gray PNG of the image in base64, white where the stroke is.
    """

    kind: StrokeKind
    points: Annotated[list[tuple[Pixels, Pixels]], Field(default_factory=list, max_length=MAX_STROKE_POINTS)]
    radius: Annotated[float, Field(gt=0.0, le=1e5, allow_inf_nan=False)] = 20.0
    mask: Base64Bytes | None = None
    stops: Stops = 1.0
    color: tuple[Component, Component, Component] = (1.0, 1.0, 1.0)


class ReferenceBody(Body):
    """A reference picture: `image`, the file in base64. PNG, JPEG and WebP have display values, from which exposure and
    tone mapping of the look are removed; HDR and OpenEXR have linear radiance. `fit_exposure`: only its relative
    brightness counts.
    """

    image: Base64Bytes
    fit_exposure: bool = False


class SolveRequest(Body):
    """Find the lights of a look from its image.

    `look`: a look document, may be partial. `camera` and `size`: of a bake with a free camera, by default the view's.
    Without strokes, the whole image is to look as the `reference`. `locked`: JSON pointers of lights that stay, such as
    `/lights/Key` or `/environment`. `change`: intensities alone, or colors, too; by default colors, too, unless all
    strokes are `brighter` or `darker`. `rotate`: the environment may rotate, which renders it about 25 times.
    `materials`: names of materials whose colors and parameters may change; at most 12 steps, each of which renders an
    image of each light and one of each number.
    """

    bake: Id
    view: Name
    look: Annotated[dict[str, Any], Field(default_factory=dict)]
    camera: CameraFrame | None = None
    size: tuple[Side, Side] | None = None
    strokes: Annotated[list[StrokeBody], Field(default_factory=list, max_length=MAX_STROKES)]
    reference: ReferenceBody | None = None
    locked: Annotated[list[Pointer], Field(default_factory=list, max_length=MAX_LOCKED)]
    change: Literal["intensity", "color"] | None = None
    rotate: bool = False
    materials: Annotated[list[Name], Field(default_factory=list, max_length=MAX_MATERIALS)]


class SourceChange(Body):
    """Change of a light. `pointer`: JSON pointer of the light in the look. `stops`: of its luminance; null from or to
    black.
    """

    pointer: str
    stops: float | None


class ShortfallBody(Body):
    """A part of the target that cannot be reached. `stroke`: its index, null for a whole reference picture. `cause`:
    all lights that reach it are `locked`; `no_light` reaches it; or lights that do, reach other pixels, too
    (`conflict`). `asked_stops`, `reached_stops`: change of its mean luminance, null from or to black.
    """

    stroke: int | None
    residual: float
    cause: Literal["locked", "no_light", "conflict"]
    asked_stops: float | None
    reached_stops: float | None


class SolveBody(Body):
    """The solution. `patch`: JSON Patch on the complete look; `look`: the look of the request with these changes.
    `changes`: changed lights; `materials`: names of changed materials, whose terms the patch replaces.
    `residual`, `residual_before`: relative RMS error of the marked pixels; 0 if none are marked.
    """

    patch: list[PatchOperation]
    look: dict[str, Any]
    residual: float
    residual_before: float
    changes: list[SourceChange]
    materials: list[str]
    shortfalls: list[ShortfallBody]
