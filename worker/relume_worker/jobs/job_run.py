"""One run of a job, by the service that has its lease."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic

from relume.core.errors import CancelledError
from relume_worker.jobs.job import Job, Request, noun
from relume_worker.jobs.step import Step
from relume_worker.jobs.step_timer import StepTimer

if TYPE_CHECKING:
    from relume_worker.jobs.job_kind import JobKind
    from relume_worker.jobs.job_service import JobService

_CHECK_INTERVAL_S = 0.1


class JobRun(Generic[Request]):
    """Steps of a running job, in other processes; used by `JobKind.run`.

    Attributes:
        job: as it was when it was claimed. folder: its files. timer: of its steps.
    """

    def __init__(self, service: JobService, kind: JobKind[Request], job: Job[Request]) -> None:
        self._service, self._kind, self.job = service, kind, job
        self.folder: Path = kind.folder / job.id
        self.timer = StepTimer(kind.step_s(job.request))
        self._needed_until_s, self._has_failed = 0.0, False

    def record(self, done: int) -> None:
        """Record the number of finished steps; the last one is recorded when the run ends.

        Raises:
            CancelledError: the job was stopped, deleted or taken over, or the service is closing.
        """
        done = min(done, self.job.total - 1)
        if self._service.is_closing or not self._service.ledger.update_leased(self.job.id, state="running", done=done):
            raise CancelledError(f"the {noun(self._kind.name)} was stopped")

    def is_needed(self) -> bool:
        """True unless the job was stopped, deleted or taken over a moment ago, or the service is closing."""
        if self._service.is_closing or self._has_failed:
            return False
        if time.monotonic() < self._needed_until_s:
            return True  # steps ask thousands of times per second
        is_needed = self._service.ledger.holds_lease(self.job.id)
        self._needed_until_s = time.monotonic() + _CHECK_INTERVAL_S if is_needed else 0.0
        return is_needed

    def step(
        self, kind: str, values: Mapping[str, Any], report: Callable[[float], object] = lambda fraction: None
    ) -> Mapping[str, Any]:
        """Run a step in another process, while the job is wanted.

        Args:
            kind, values: of the step. report: called with the fraction done.
        """
        claim = str(self.folder), self._service.ledger.owner
        step = Step(kind, self._kind.is_first(self.job.request), values, claim, self.job.user)
        return self._service.run_step(step, report, self.is_needed)

    def timed_step(self, index: int, kind: str, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Run one of the steps that the job counts. index: of the step."""
        self.timer.start()
        answer = self.step(kind, values, lambda fraction: self.timer.report(index, fraction))
        self.timer.finish(index)
        return answer

    def timed_steps(self, kind: str, values: Mapping[int, Mapping[str, Any]], done: int) -> None:
        """Run several steps that the job counts, as many at once as there are places for them.

        Args:
            kind: of the steps. values: by index. done: number of steps that are finished already.
        Raises:
            The error of the first step that fails; the others are canceled.
        """
        with ThreadPoolExecutor(max(1, min(len(values), self._service.num_places())), "relume-steps") as threads:
            futures = [threads.submit(self.timed_step, index, kind, each) for index, each in values.items()]
            try:
                for num, future in enumerate(as_completed(futures), 1):
                    future.result()
                    self.record(done + num)
            except BaseException:
                self._has_failed = True
                raise
            finally:
                for future in futures:
                    future.cancel()
