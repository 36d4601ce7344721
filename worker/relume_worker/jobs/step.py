"""A step of a job: small enough for a message of JSON; its results are files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

ProgressCallback = Callable[[float], object]
IsNeeded = Callable[[], bool]


@dataclass(frozen=True)
class Step:
    """A step to run.

    Attributes:
        kind: key of `relume_server.batch.step_registry.STEPS`.
        is_first: somebody waits for it: it takes an urgent slot, and does not wait for its client's turn.
        values: arguments of the step; JSON.
        claim: folder and lease owner of its job, see `relume_worker.jobs.claim`; None: no job.
        client: who submitted the job; bulk work is shared fairly among clients.
        priority: of the job among those of its client.
    """

    kind: str
    is_first: bool = False
    values: Mapping[str, Any] = field(default_factory=dict)
    claim: tuple[str, str] | None = None
    client: str = ""
    priority: int = 0


class RunStep(Protocol):
    """Runs steps; blocks."""

    def __call__(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        """Run one step.

        Args:
            step: runs once, or twice if its process ended.
            report: called with the fraction done, 0…1. is_needed: polled a few times per second.
        Returns:
            Result of the step.
        Raises:
            CancelledError: it was no longer needed. RelumeError: it failed, with the cause.
        """
        ...


class StepExecutor(Protocol):
    """Runs steps in worker processes; see `relume_server.batch.cluster_steps`."""

    @property
    def run(self) -> RunStep: ...
    def num_slots(self) -> int:
        """Number of bulk steps that run at once."""
        ...

    def close(self) -> None: ...
