"""A step of batch work: small enough for a line of JSON; its results are files."""

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
        is_first: interactive; runs before long steps.
        values: arguments of the step; JSON.
        claim: folder and lease owner of its job, see `relume_server.batch.step_claim`; None: no job.
    """

    kind: str
    is_first: bool = False
    values: Mapping[str, Any] = field(default_factory=dict)
    claim: tuple[str, str] | None = None


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


class Batches(Protocol):
    """Runs steps in processes; see `relume_server.batch.pool`."""

    @property
    def run(self) -> RunStep: ...
    def resident_bytes(self) -> int: ...
    def release(self) -> None: ...
    def close(self) -> None: ...
