"""Bodies of BTFs that are made or imported."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from relume_server.schemas.base import Body, Id, JobState, Name

Geometry = Literal["weave", "pebbles", "corduroy"]
GeometrySource = Literal[Geometry, "mesh"]
Texels = Annotated[int, Field(ge=8, le=256)]
Period = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False, description="side of what repeats, metres")]
TEXELS = 128
Bound = Annotated[float, Field(ge=1e-4, le=0.5, description="relative RMS that compression may miss")]
BOUND = 0.05


class SyntheticBtfRequest(Body):
    """A BTF to be rendered from a small geometry, `size` texels wide; nothing of it is measured."""

    geometry: Geometry
    size: Texels = TEXELS
    error: Bound = BOUND
    name: Name | None = None


class BtfRequest(Body):
    """A BTF to be made: rendered from `geometry`, which for `mesh` was sent, or of images that were sent."""

    name: Name
    error: Bound
    geometry: GeometrySource | None = None
    size: int = 0
    period: Period | None = None


class BtfJobBody(Body):
    """A BTF in the making. `material`: its id where it is ready. `geometry`: null where images were sent. `user` asked
    for it; `created`, `started` and `ended` are times; null: not yet."""

    id: Id
    name: str
    user: str
    geometry: GeometrySource | None
    state: JobState
    created: str
    started: str | None
    ended: str | None
    progress: float
    seconds_left: float | None
    material: Id | None
    problem: str | None
