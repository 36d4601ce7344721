"""Interface of a kind of jobs to the service that runs them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from typing import Any, ClassVar

from relume_worker.jobs.fair_share import Waiting

MAX_RUNNING = 64
MAX_RUNNING_PER_CLIENT = 4
"""More would only wait for their turns, and could not run on another server; small jobs are not counted."""


class Kind(ABC):
    """Jobs of one kind: bakes, or requests (`relume_worker.jobs.job_kind`).

    A job may end at any time, with its process; another process runs it again, and finds what was done.
    """

    name: ClassVar[str]

    @abstractmethod
    def perform(self, work: Waiting) -> Mapping[str, Any]:
        """Run a job whose lease is here.

        Returns:
            Columns of its row when it is ready.
        Raises:
            CancelledError: it is no longer wanted, or the service is closing. NotFoundError: it was deleted. Any other
                exception: it has failed.
        """

    @abstractmethod
    def error_text(self, identity: str, error: Exception) -> str:
        """One sentence about the exception of a failed job, for its row."""

    def has_room(self, work: Waiting, running: Collection[Waiting]) -> bool:
        """True if a job may start beside those of its lane that run here."""
        num_own = sum(other.client == work.client and not other.is_first for other in running)
        return work.is_first or (len(running) < MAX_RUNNING and num_own < MAX_RUNNING_PER_CLIENT)

    def on_ready(self, identity: str) -> None:  # noqa: B027
        """Called after the row is ready, by the owner of the lease."""

    def on_failed(self, identity: str) -> None:  # noqa: B027
        """Called after the row has failed, by the owner of the lease."""

    def on_blocked(self, identity: str, error: Exception) -> None:  # noqa: B027
        """Called when the ledger could not record a job: it is claimed again."""

    def on_deleted(self, identity: str) -> None:  # noqa: B027
        """Called when a job that was running here turns out to be deleted."""
