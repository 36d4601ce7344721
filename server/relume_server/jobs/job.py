"""State of a job, and the limits of a queue."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from relume_server.persistence.tables import JobRow

ACTIVE = ("queued", "running")
STATES = (*ACTIVE, "ready", "failed", "stopped")
UNREADABLE = "the request cannot be read, because another version of relume wrote it or it is damaged; request it again"

Request = TypeVar("Request", bound=BaseModel)


@dataclass(frozen=True)
class Quota:
    """Limits of queued and running jobs of one kind, in total and per client, and the clients' weights.

    Attributes:
        weights: see `relume_worker.fair_share.FairShare`.
    """

    max_total: int
    max_per_client: int
    weights: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Job(Generic[Request]):
    """State of one row.

    Attributes:
        request: body of the call. user: caller; "" without login.
        completed, total: steps. progress: 0…1, including part of the current step.
        seconds_left: None if the job is not running, or nothing has been measured yet.
        problem: cause of the failure, one sentence.
        created, started, ended: seconds since 1970; None: not yet, or the row is of an older version.
    """

    id: str
    request: Request
    user: str
    state: str
    completed: int
    total: int
    progress: float
    seconds_left: float | None
    problem: str | None
    created: float
    started: float | None
    ended: float | None


@dataclass(frozen=True)
class JobFilter:
    """Filter of a list of jobs; None: any. bake, name: bake and name of their requests."""

    state: str | None = None
    user: str | None = None
    bake: str | None = None
    name: str | None = None


def read_row(row: JobRow, placeholder: Request) -> tuple[Request, str, str | None]:
    """Read the request, the state and the problem of a row.

    Args:
        row: row of a job.
        placeholder: request that is returned, with the state "failed", if the row's request cannot be read.
    """
    try:
        return type(placeholder).model_validate_json(row.request), row.state, row.problem
    except ValidationError:
        return placeholder, "failed", UNREADABLE


def new_id() -> str:
    """Create an id for a job."""
    return secrets.token_hex(8)
