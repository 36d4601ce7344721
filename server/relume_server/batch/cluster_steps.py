"""Runs steps in worker processes, on this machine or on others: the same that bake.

A step reports its progress in a file next to its results, and ends when its folder is claimed by another owner: both
work on every machine that shares the data directory.
"""

from __future__ import annotations

import shutil
import threading
import uuid
from collections.abc import Mapping
from concurrent.futures import CancelledError as FutureCancelledError
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from relume.core.errors import CancelledError, DiskFullError, NotFoundError, RelumeError, StoreError, StoreNotFoundError
from relume_server.batch.worker_process import ProcessSettings, run_step
from relume_worker.executor import BULK, URGENT, Executors
from relume_worker.jobs.claim import claim
from relume_worker.jobs.fair_slots import FairSlots
from relume_worker.jobs.step import IsNeeded, ProgressCallback, Step
from relume_worker.runner import SCHEDULER_LOST_MESSAGE, is_lost_process

_POLL_S = 0.1
_TRIES = 2


class _NoRoomError(DiskFullError):
    """A step found the disk full; with its message."""

    def __init__(self, message: str) -> None:
        RelumeError.__init__(self, message)


_ERRORS_BY_KIND: Mapping[str, type[RelumeError]] = {
    "store-not-found": StoreNotFoundError,
    "store": StoreError,
    "not-found": NotFoundError,
    "disk": _NoRoomError,
}
"""Expected errors of a step, by the last part of the problem's type."""


class ClusterSteps:
    """Implements `relume_worker.jobs.step.StepExecutor`.

    Args:
        executors: of the worker processes. process: settings of a step's process. weights: of clients, see `FairShare`.
    """

    def __init__(self, executors: Executors, process: ProcessSettings, weights: Mapping[str, float]) -> None:
        self._executors, self._process = executors, process
        self._slots = FairSlots(executors.num_processes, weights)
        self._closing = threading.Event()

    def num_slots(self) -> int:
        """Number of bulk steps that run at once."""
        return self._executors.num_processes()

    def run(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        """Run a step, see `RunStep`."""

        def is_wanted() -> bool:
            return not self._closing.is_set() and is_needed()

        slot: AbstractContextManager[None] = nullcontext() if step.is_first else self._slots.take(step, is_wanted)
        with self._executors.keep_cluster(), slot:
            if step.claim is not None:
                return self._run_claimed(step, step.claim, report, is_wanted)
            folder = Path(self._process.data) / "steps" / uuid.uuid4().hex
            folder.mkdir(parents=True)
            own_claim = str(folder), folder.name
            claim(folder, folder.name)
            try:
                return self._run_claimed(replace(step, claim=own_claim), own_claim, report, is_wanted)
            finally:
                shutil.rmtree(folder, ignore_errors=True)

    def close(self) -> None:
        """Stop waiting for steps."""
        self._closing.set()

    def _run_claimed(
        self, step: Step, own_claim: tuple[str, str], report: ProgressCallback, is_needed: IsNeeded
    ) -> Mapping[str, Any]:
        progress_file = Path(own_claim[0]) / f".progress-{uuid.uuid4().hex}"
        executor = self._executors.cluster(URGENT if step.is_first else BULK)
        try:
            for _ in range(_TRIES):
                future = executor.submit(run_step, self._process, step, str(progress_file))
                try:
                    return _answer(_result(future, step, progress_file, report, is_needed))
                except RelumeError:
                    raise
                except Exception as error:
                    if not is_lost_process(error):
                        raise
        finally:
            progress_file.unlink(missing_ok=True)
        raise RelumeError(
            f"the process of the {step.kind} was killed twice, perhaps because memory ran out; give a "
            "smaller size, or free memory and try again"
        )


def _result(
    future: Future[Mapping[str, Any]], step: Step, progress_file: Path, report: ProgressCallback, is_needed: IsNeeded
) -> Mapping[str, Any]:
    """Wait for the result of a step, and report its progress. A step that is no longer needed ends by itself."""
    while True:
        try:
            return future.result(_POLL_S)
        except FutureTimeoutError:
            with suppress(OSError, ValueError):
                report(float(progress_file.read_text()))
            if not is_needed():
                raise CancelledError(f"the {step.kind} was stopped") from None
        except FutureCancelledError:
            raise RelumeError(SCHEDULER_LOST_MESSAGE) from None


def _answer(message: Mapping[str, Any]) -> Mapping[str, Any]:
    if "canceled" in message:
        raise CancelledError("the step was stopped")
    if "problem" in message:
        raise _ERRORS_BY_KIND.get(message["kind"], RelumeError)(message["problem"])
    answer: Mapping[str, Any] = message["answer"]
    return answer
