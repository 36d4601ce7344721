"""Kinds of jobs that are requests with steps, and what they have in common.

To add a kind, write a subclass, and pass it to the `JobService`.
"""

from __future__ import annotations

import shutil
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Generic

from relume.core.errors import DiskFullError
from relume_worker.database.models import JobRow
from relume_worker.job_state import ACTIVE_STATES
from relume_worker.jobs.claim import claim
from relume_worker.jobs.fair_share import Waiting
from relume_worker.jobs.job import UNREADABLE, Job, JobFilter, NotReadyError, Request, new_id, read_row
from relume_worker.jobs.job_run import JobRun
from relume_worker.jobs.job_service import JobService
from relume_worker.jobs.kind import Kind
from relume_worker.jobs.step_timer import StepTimer


class JobKind(Kind, Generic[Request]):
    """Jobs of one kind; their files are in `folder`/<id>/.

    A subclass defines its name, the number of steps, the priority, `run`, and a placeholder of requests that cannot be
    read. Finished steps must be files, because another process may resume the job: after a kill, an update, or a
    takeover.
    """

    placeholder: Request
    resumable: ClassVar[Sequence[str]] = ("canceled", "failed")
    """States from which a job can be resumed: its files are still there."""

    def __init__(self, service: JobService, folder: Path) -> None:
        """
        Args:
            service: runs the jobs. folder: created if missing.
        """
        self._service, self.folder = service, folder
        self._timers: dict[str, StepTimer] = {}
        self._blocked: dict[str, str] = {}  # reasons that the ledger cannot store, such as a full disk
        service.add_kind(self)

    @abstractmethod
    def steps(self, request: Request) -> int:
        """Number of steps of a request, at least one."""

    @abstractmethod
    def is_first(self, request: Request) -> bool:
        """True if somebody waits for the job: small ones."""

    @abstractmethod
    def run(self, run: JobRun[Request]) -> None:
        """Run the missing steps of a job. Raises CancelledError: the job is no longer wanted."""

    def priority(self, request: Request) -> int:
        """Higher ones are first among the jobs of a client."""
        return 0

    def step_s(self, request: Request) -> float | None:
        """Seconds per step of earlier requests like this; None if unknown."""
        return None

    def perform(self, work: Waiting) -> Mapping[str, Any]:
        """Read the request, claim the folder, and run the steps."""
        self._blocked.pop(work.id, None)
        job = self.get(work.id)
        self.check_readable(job)
        folder, (is_first, step_s) = self.folder / job.id, (self.is_first(job.request), self.step_s(job.request))
        folder.mkdir(parents=True, exist_ok=True)
        claim(folder, self._service.ledger.owner)
        run = JobRun(self._service, self.name, job, folder, is_first=is_first, step_s=step_s, priority=work.priority)
        self._timers[job.id] = run.timer
        try:
            self.run(run)
        finally:
            del self._timers[job.id]
        return {"done": job.total}

    def error_text(self, identity: str, error: Exception) -> str:
        """The service's sentence."""
        return self._service.describe(error)

    def on_blocked(self, identity: str, error: Exception) -> None:
        """Keep the reason until the job goes on."""
        if isinstance(error, DiskFullError):
            self._blocked[identity] = f"{error}; the job resumes by itself"

    def on_deleted(self, identity: str) -> None:
        """Delete the files."""
        self._blocked.pop(identity, None)
        shutil.rmtree(self.folder / identity, ignore_errors=True)

    def submit(
        self,
        request: Request,
        client: str = "",
        prepare: Callable[[Path], object] | None = None,
        identity: str | None = None,
    ) -> str:
        """Queue a validated request.

        Args:
            request: body of the call. client: caller; clients are scheduled fairly.
            prepare: writes the job's inputs into its folder; quick.
            identity: from `new_id`, if the caller needs the id before the job can start.
        Returns:
            The id of the job.
        Raises:
            BusyError, QuotaError: the limit of all jobs, or of this client, is reached.
        """
        identity = identity or new_id()
        folder = self.folder / identity

        def prepare_folder() -> None:
            if prepare is not None:
                folder.mkdir(parents=True)
                prepare(folder)

        text, is_first = request.model_dump_json(), self.is_first(request)
        row = JobRow(id=identity, kind=self.name, request=text, client=client, is_first=is_first)
        row.priority = self.priority(request)
        self._service.ledger.add(row, prepare_folder)
        self._service.wake()
        return identity

    def get(self, identity: str) -> Job[Request]:
        """Return a job. Raises NotFoundError."""
        return self.job(self._service.ledger.get(self.name, identity))

    def job(self, row: JobRow) -> Job[Request]:
        """Return the job of a row."""
        request, state, problem = read_row(row, self.placeholder)
        total, timer = self.steps(request), self._timers.get(row.id) if row.state == "running" else None
        progress = min(1.0, (row.done + (timer.fraction if timer is not None else 0.0)) / total)
        seconds_left = timer.seconds_left(total - row.done) if timer is not None else None
        if state in ACTIVE_STATES:
            problem = problem or self._blocked.get(row.id)
        times = row.created, row.started, row.ended
        return Job(row.id, request, row.client or "", state, row.done, total, progress, seconds_left, problem, *times)

    def check_readable(self, job: Job[Request]) -> None:
        """Check that the request of a job could be read. Raises NotReadyError."""
        if job.request is self.placeholder:
            raise NotReadyError(UNREADABLE)

    def page(
        self, job_filter: JobFilter, limit: int, after: tuple[float, str] | None = None, *, newest_first: bool = True
    ) -> list[Job[Request]]:
        """List jobs of this kind, newest first or last.

        Args:
            job_filter: filter of the list. limit: maximum number.
            after: time of creation and id of the job before the page; None: start with the first.
            newest_first: order.
        """
        rows = self._service.ledger.page(self.name, job_filter, limit, after, newest_first=newest_first)
        return [self.job(row) for row in rows]

    def referencing(self, text: str) -> list[str]:
        """Ids of queued and running jobs whose request contains a text, oldest first."""
        return self._service.ledger.referencing(self.name, text)

    def delete(self, identity: str) -> None:
        """Stop a job and delete its files. Raises NotFoundError."""
        self.get(identity)
        try:
            self._service.ledger.delete([identity])
        except DiskFullError:  # deleting a row needs space, too: first free that of the files
            shutil.rmtree(self.folder / identity, ignore_errors=True)
            self._service.ledger.delete([identity])
        shutil.rmtree(self.folder / identity, ignore_errors=True)

    def stop(self, identity: str) -> None:
        """Stop a queued or running job; its files stay for `resume`. Raises NotFoundError."""
        self.get(identity)
        self._service.ledger.cancel(identity)

    def resume(self, identity: str) -> None:
        """Queue a stopped or failed job again; no effect on a queued or running one.

        Raises:
            NotFoundError. NotReadyError: it is ready, or its files are deleted. BusyError, QuotaError: as `submit`.
        """
        if self.get(identity).state not in ACTIVE_STATES:
            self.requeue(identity, self.resumable)

    def requeue(self, identity: str, states: Sequence[str], prepare: Callable[[], object] = lambda: None) -> None:
        """Queue a job in one of some states again.

        Args:
            identity: id of the job. states: states from which it may be queued.
            prepare: called before it can start.
        Raises:
            NotReadyError: it is in another state, or its request cannot be read. BusyError, QuotaError: as `submit`.
        """
        row = self._service.ledger.get(self.name, identity)
        self.check_readable(self.job(row))
        self._service.ledger.requeue(row, states, prepare)
        self._service.wake()
