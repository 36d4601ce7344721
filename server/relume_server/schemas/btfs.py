"""Bodies of BTF jobs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from relume_server.schemas.base import Body, Id, Name
from relume_worker.job_state import JobState

Geometry = Literal["weave", "pebbles", "corduroy"]
GeometrySource = Literal[Geometry, "mesh"]
Texels = Annotated[int, Field(ge=8, le=256)]
Period = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False, description="side of one period, meters")]
TEXELS = 128
Bound = Annotated[float, Field(ge=1e-4, le=0.5, description="relative RMS error allowed in compression")]
BOUND = 0.05


class SyntheticBtfRequest(Body):
    """A synthetic BTF to render from a small geometry, `size` texels wide."""

    geometry: Geometry
    size: Texels = TEXELS
    error: Bound = BOUND
    name: Name | None = None


class BtfRequest(Body):
    """A BTF to make: rendered from `geometry` (for `mesh` an uploaded file), or compressed from uploaded images."""

    name: Name
    error: Bound
    geometry: GeometrySource | None = None
    size: int = 0
    period: Period | None = None


class BtfJobBody(Body):
    """A BTF job. `material`: its id when ready. `geometry`: null for uploaded images. `user`: who requested it;
    `created`, `started` and `ended` are times; null: not yet.
    """

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
