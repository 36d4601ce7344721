"""One run of a job, by the service that has its lease."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, Generic

from relume.core.errors import CancelledError
from relume.store.disk_space import check_disk_space
from relume_worker.jobs.job import Job, Request, noun
from relume_worker.jobs.job_service import JobService
from relume_worker.jobs.step import Step
from relume_worker.jobs.step_timer import StepTimer


class JobRun(Generic[Request]):
    """Steps of a running job, in other processes; used by `JobKind.run`.

    Attributes:
        job: state of the job when it was claimed. folder: folder of its files. timer: timer of its steps.
    """

    def __init__(
        self,
        service: JobService,
        kind: str,
        job: Job[Request],
        folder: Path,
        *,
        is_first: bool,
        step_s: float | None,
        priority: int,
    ) -> None:
        """
        Args:
            service: runs the steps. kind: name of its kind. job: state of the job. folder: folder of its files.
            is_first: True if somebody waits for it. step_s: seconds per step of earlier jobs; None if unknown.
            priority: among the jobs of its client.
        """
        self._service, self._kind, self._is_first, self._priority = service, kind, is_first, priority
        self.job, self.folder, self.timer = job, folder, StepTimer(step_s)
        self._error: BaseException | None = None  # of the first step that failed

    def record(self, done: int) -> None:
        """Record the number of finished steps; the last one is recorded when the run ends.

        Raises:
            CancelledError: the job was stopped, deleted or taken over, or the service is closing.
        """
        done = min(done, self.job.total - 1)
        if self._service.is_closing or not self._service.ledger.update_leased(self.job.id, state="running", done=done):
            raise CancelledError(f"the {noun(self._kind)} was stopped")

    def is_needed(self) -> bool:
        """True unless the job was stopped, deleted or taken over a moment ago, or the service is closing."""
        is_over = self._service.is_closing or self._error is not None
        return not is_over and self._service.ledger.holds_lease(self.job.id)

    def step(
        self,
        kind: str,
        values: Mapping[str, Any],
        report: Callable[[float], object] = lambda fraction: None,
        num_bytes: int = 0,
    ) -> Mapping[str, Any]:
        """Run a step in another process, while the job is wanted.

        Args:
            kind: kind of the step. values: its arguments. report: called with the fraction done.
            num_bytes: size of the files that it writes, if known.
        Raises:
            DiskFullError: they do not fit; files of earlier steps stay.
        """
        check_disk_space(self.folder, num_bytes, f"the files of a {noun(self._kind)}")
        claim = str(self.folder), self._service.ledger.owner
        step = Step(kind, self._is_first, values, claim, self.job.user, self._priority)
        return self._service.run_step(step, report, self.is_needed)

    def timed_step(self, index: int, kind: str, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Run one of the steps that the job counts.

        Args:
            index: index of the step. kind: kind of the step. values: its arguments.
        """
        if self._error is not None:
            raise CancelledError(f"an earlier step of the {noun(self._kind)} has failed")
        self.timer.start()
        try:
            answer = self.step(kind, values, lambda fraction: self.timer.report(index, fraction))
        except BaseException as error:
            self._error = self._error or error
            raise
        self.timer.finish(index)
        return answer

    def timed_steps(self, kind: str, values: Mapping[int, Mapping[str, Any]], done: int) -> None:
        """Run several steps that the job counts, as many at once as there are slots for them.

        Args:
            kind: kind of the steps. values: their arguments, by index. done: number of steps that are finished already.
        Raises:
            The error of the first step that fails; the others are canceled.
        """
        with ThreadPoolExecutor(max(1, min(len(values), self._service.num_slots())), "relume-steps") as threads:
            futures = [threads.submit(self.timed_step, index, kind, each) for index, each in values.items()]
            try:
                for num, future in enumerate(as_completed(futures), 1):
                    future.result()
                    self.record(done + num)
            except CancelledError:  # of a step that ended because another had failed, perhaps
                raise self._error or CancelledError(f"the {noun(self._kind)} was stopped") from None
            finally:
                for future in futures:
                    future.cancel()
