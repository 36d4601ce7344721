"""One step of work that runs apart: small enough to be a line of JSON, and its files say what was done."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

ProgressCallback = Callable[[float], object]
IsNeeded = Callable[[], bool]


@dataclass(frozen=True)
class Step:
    """What to do.

    Attributes:
        kind: a name in `relume_server.batch.step_registry.STEPS`.
        is_first: somebody waits for it; it goes before what takes its time.
        values: arguments of the step; JSON.
        claim: folder and owner of the job whose step it is, see `relume_server.batch.step_claim`; None: no job.
    """

    kind: str
    is_first: bool = False
    values: Mapping[str, Any] = field(default_factory=dict)
    claim: tuple[str, str] | None = None


class RunStep(Protocol):
    """Runs steps; blocks."""

    def __call__(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        """Do one step.

        Args:
            step: is done once, or once more where a process ended under it.
            report: called with the share done, 0…1. is_needed: asked a few times a second.
        Returns:
            What the step answers.
        Raises:
            CancelledError: it was not wanted any more. RelumeError: it failed; the sentence says why.
        """
        ...


class Batches(Protocol):
    """Where steps are done; see `relume_server.batch.pool`."""

    @property
    def run(self) -> RunStep: ...
    def resident_bytes(self) -> int: ...
    def release(self) -> None: ...
    def close(self) -> None: ...
