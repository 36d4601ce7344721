"""States of bakes and of all other jobs."""

from __future__ import annotations

from typing import Literal

JobState = Literal["queued", "running", "ready", "failed", "canceled"]
ACTIVE_STATES: tuple[JobState, ...] = ("queued", "running")
FINAL_STATES: frozenset[JobState] = frozenset({"ready", "failed", "canceled"})
