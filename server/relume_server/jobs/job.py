"""One long work as everybody outside of the queue sees it, and how much of it there may be."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from pydantic import BaseModel

ACTIVE = ("queued", "running")
STATES = (*ACTIVE, "ready", "failed", "stopped")

Request = TypeVar("Request", bound=BaseModel)


@dataclass(frozen=True)
class Quota:
    """How much work of one kind may wait or run: of all clients together, and of each; and whose turns are how many.

    Attributes:
        weights: see `relume_worker.fair_share.FairShare`.
    """

    max_total: int
    max_per_client: int
    weights: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Job(Generic[Request]):
    """One row at one moment.

    Attributes:
        request: the body of the call that asked for it. user: who called; "" where nobody logs in.
        completed, total: steps. progress: 0…1; what is done of the step at hand counts too.
        seconds_left: None where the work does not run, or nothing was measured yet.
        problem: why it failed, one sentence.
        created, started, ended: seconds since 1970; None: not yet, or an older relume has not written it down.
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
    """Which works a list shows; None: any. bake, name: of their requests."""

    state: str | None = None
    user: str | None = None
    bake: str | None = None
    name: str | None = None


def new_id() -> str:
    """A name for a work."""
    return secrets.token_hex(8)
