"""State of a job, and the limits of jobs."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from relume.core.errors import RelumeError
from relume_worker.database.models import JobRow

BAKE = "bake"
UNREADABLE = "the request cannot be read, because another version of relume wrote it or it is damaged; request it again"

Request = TypeVar("Request", bound=BaseModel)


class NotReadyError(RelumeError):
    """A resource is not in the state that the call needs."""


class BusyError(RelumeError):
    """The server is at capacity; retrying may succeed."""


class QuotaError(RelumeError):
    """The caller has reached a quota."""


@dataclass(frozen=True)
class Quota:
    """Limits of queued and running jobs of each kind, in total and per client."""

    max_total: int
    max_per_client: int


@dataclass(frozen=True)
class Job(Generic[Request]):
    """State of one job.

    Attributes:
        request: body of the call. user: caller; "" without login.
        completed, total: steps. progress: 0…1, including parts of the current steps.
        seconds_left: None if the job is not running here, or nothing has been measured yet.
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


def lane(kind: str, *, is_first: bool) -> str:
    """Lane of a job. Those of a lane take turns: small bakes, other bakes, and all other jobs.

    Args:
        kind: name of its kind. is_first: it is small.
    """
    return "jobs" if kind != BAKE else "small bakes" if is_first else "bakes"


def new_id() -> str:
    """Create an id for a job."""
    return secrets.token_hex(8)


def noun(kind: str) -> str:
    """Return the word for a kind of job in messages."""
    return {"btf": "BTF"}.get(kind, kind)
