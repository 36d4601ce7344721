"""State of a job, and the limits of jobs."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Generic, TypeVar

from pydantic import BaseModel

from relume.core.errors import RelumeError

ACTIVE = ("queued", "running")
STATES = (*ACTIVE, "ready", "failed", "stopped")

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
    """Filter of a list of jobs; None: any. bake, name: of their requests."""

    state: str | None = None
    user: str | None = None
    bake: str | None = None
    name: str | None = None


def new_id() -> str:
    """Create an id for a job."""
    return secrets.token_hex(8)


def noun(kind: str) -> str:
    """Return the word for a kind of job in messages."""
    return {"btf": "BTF"}.get(kind, kind)
