"""Job queue: rows of a table, and one thread that runs them step by step with fair scheduling.

A row is queued, running, ready, failed or stopped. Several servers may share the rows and the files: the one that runs
a step has the row's lease meanwhile. Another server, or the next start, resumes the jobs of a killed server; jobs must
save their finished steps on disk.

Libraries for this (Celery, Dramatiq, RQ, Huey) run functions in separate processes behind a broker. Here the row is the
REST resource, clients are scheduled between the steps of one job, a step yields to every active control, and a server
needs nothing but its database.
"""

from __future__ import annotations

import json
import logging
import shutil
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar, Generic, cast

from sqlalchemy import CursorResult, Select, and_, func, or_, select, update
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import CancelledError, NotFoundError, RelumeError
from relume_server.batch.step import RunStep, Step
from relume_server.batch.step_claim import claim
from relume_server.batch.step_timer import StepTimer
from relume_server.errors import BusyError, NotReadyError, QuotaError, make_problem
from relume_server.jobs.job import ACTIVE, STATES, UNREADABLE, Job, JobFilter, Quota, Request, new_id, read_row
from relume_server.persistence.tables import JobRow
from relume_worker.database.clock import epoch_s
from relume_worker.database.failures import DatabaseError
from relume_worker.fair_share import FairShare, WaitingBake
from relume_worker.lease import LeaseRenewer, is_alive, log_lost_lease, log_taken_over, new_owner

log = logging.getLogger(__name__)
_POLL_INTERVAL_S = 2.0
_CHECK_INTERVAL_S = 0.1


class JobQueue(ABC, Generic[Request]):
    """Jobs of one kind; their files are in `folder`/<id>/.

    A subclass defines the table, the noun for messages, the number of steps, the priority, a step, and a placeholder
    of requests that cannot be read.

    Only the owner of a row's lease changes its state, its files and its quota. A server that was suspended for longer
    than the lease notices at its next statement on the row, and drops its work.
    """

    row: ClassVar[type[JobRow]]
    noun: ClassVar[str]
    placeholder: Request
    resumable: ClassVar[Sequence[str]] = ("stopped", "failed")
    """States from which a job can be resumed: its files are still there."""

    def __init__(self, sessions: sessionmaker[Session], folder: Path, run: RunStep, quota: Quota) -> None:
        """
        Args:
            sessions: sessions of the database. folder: created if missing.
            run: runs a step in another process. quota: limits of the queue.
        """
        self._sessions, self.folder, self.run, self._quota = sessions, folder, run, quota
        self._owner = new_owner()
        self._fair_share, self._timers = FairShare(quota.weights), dict[str, StepTimer]()
        self._wake, self._closing = threading.Event(), threading.Event()
        self._needed_until: tuple[str, float] = "", 0.0
        self._outage = DatabaseError(log, f"the queue of {self.noun}s cannot be read or written")
        self._thread = threading.Thread(target=self._run, name=f"relume-{self.noun}s", daemon=True)

    @abstractmethod
    def steps(self, request: Request) -> int:
        """Number of steps of a request, at least one."""

    @abstractmethod
    def step_s(self, request: Request) -> float | None:
        """Seconds per step of earlier requests like this; None if unknown."""

    @abstractmethod
    def is_first(self, request: Request) -> bool:
        """True for small requests, which go first."""

    @abstractmethod
    def step(self, job: Job[Request], timer: StepTimer) -> int:
        """Run the next step; call `note` first, and report to `timer`.

        Returns:
            The number of finished steps; the total if the job is finished.
        Raises:
            CancelledError: the job is no longer wanted.
        """

    def on_failed(self, job: Job[Request]) -> None:
        """Called after the row has failed, by the owner of the lease; by default files are kept."""

    def on_ready(self, job: Job[Request]) -> None:
        """Called after the row is ready, by the owner of the lease; by default files are kept."""

    def run_in_process(
        self, job: Job[Request], kind: str, values: Mapping[str, Any], report: Callable[[float], object]
    ) -> Mapping[str, Any]:
        """Run a step in another process, while the job is wanted.

        Args:
            job: job of the step. kind, values: kind and values of the step. report: called with the fraction done.
        """
        step = Step(kind, self.is_first(job.request), values, (str(self.folder / job.id), self._owner))
        return self.run(step, report, lambda: self.is_needed(job.id))

    def start(self) -> None:
        """Start the thread, which resumes unfinished jobs."""
        self._thread.start()

    def close(self) -> None:
        """Finish the current step and stop; the rest is resumed at the next start."""
        self._closing.set()
        self._wake.set()
        self._thread.join(timeout=30)

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
        identity, row = identity or new_id(), self.row
        with self._sessions.begin() as session:
            self._check_quota(session, client)
            if prepare is not None:
                (self.folder / identity).mkdir(parents=True)
                prepare(self.folder / identity)
            text, created = request.model_dump_json(), time.time()
            session.add(
                row(id=identity, request=text, state="queued", done=0, created=created, client=client,
                    is_first=self.is_first(request))
            )  # fmt: skip
        self._wake.set()
        return identity

    def _check_quota(self, session: Session, client: str) -> None:
        """Check that a client may queue one more job. Raises BusyError, QuotaError."""
        quota = self._quota
        clients = session.scalars(select(self.row.client).where(self.row.state.in_(ACTIVE))).all()
        if len(clients) >= quota.max_total:
            text = f"the limit of {quota.max_total} unfinished {self.noun}s is reached; try again later"
            raise BusyError(f"{text} (RELUME_MAX_QUEUED)")
        if sum((queued_client or "") == client for queued_client in clients) >= quota.max_per_client:
            text = f"you have reached the limit of {quota.max_per_client} unfinished {self.noun}s; wait, or stop one"
            raise QuotaError(f"{text} (RELUME_MAX_QUEUED_PER_USER)")

    def get(self, identity: str) -> Job[Request]:
        """Return a job. Raises NotFoundError."""
        with self._sessions() as session:
            row = session.get(self.row, identity)
        if row is None:
            raise NotFoundError(f"there is no {self.noun} {identity[:40]}; start one first")
        return self._job(row)

    def _job(self, row: JobRow) -> Job[Request]:
        request, state, problem = read_row(row, self.placeholder)
        total, timer = self.steps(request), self._timers.get(row.id) if row.state == "running" else None
        progress = min(1.0, (row.done + (timer.fraction if timer is not None else 0.0)) / total)
        seconds_left = timer.seconds_left(total - row.done) if timer is not None else None
        ended = problem, row.created, row.started, row.ended
        return Job(row.id, request, row.client or "", state, row.done, total, progress, seconds_left, *ended)

    def _check_readable(self, job: Job[Request]) -> None:
        """Check that the request of a job could be read. Raises NotReadyError."""
        if job.request is self.placeholder:
            raise NotReadyError(UNREADABLE)

    def page(
        self, job_filter: JobFilter, limit: int, after: tuple[float, str] | None = None, *, newest_first: bool = True
    ) -> list[Job[Request]]:
        """List jobs, newest first or last.

        Args:
            job_filter: filter of the list. limit: maximum number.
            after: time of creation and id of the row before the page; None: start with the first.
            newest_first: order.
        """
        row = self.row
        query = _filtered(select(row), row, job_filter).limit(limit)
        created = row.created.desc() if newest_first else row.created
        if after is not None:
            is_later = row.created < after[0] if newest_first else row.created > after[0]
            query = query.where(or_(is_later, and_(row.created == after[0], row.id > after[1])))
        with self._sessions() as session:
            return [self._job(each) for each in session.scalars(query.order_by(created, row.id))]

    def referencing(self, text: str) -> list[str]:
        """Ids of queued and running jobs whose request contains a text, oldest first."""
        row = self.row
        query = select(row.id).where(row.state.in_(ACTIVE), row.request.contains(text, autoescape=True))
        with self._sessions() as session:
            return list(session.scalars(query.order_by(row.created)))

    def delete(self, identity: str) -> None:
        """Stop a job and delete its files. Raises NotFoundError."""
        self.get(identity)
        with self._sessions.begin() as session:
            if (row := session.get(self.row, identity)) is not None:
                session.delete(row)
        shutil.rmtree(self.folder / identity, ignore_errors=True)

    def stop(self, identity: str) -> None:
        """Stop a queued or running job; its files stay for `resume`. Raises NotFoundError."""
        self.get(identity)
        self._update(identity, ACTIVE, state="stopped", ended=time.time())

    def resume(self, identity: str) -> None:
        """Queue a stopped or failed job again; no effect on a queued or running one.

        Raises:
            NotFoundError. NotReadyError: it is ready, or its files are deleted. BusyError, QuotaError: as `submit`.
        """
        job = self.get(identity)
        if job.state not in ACTIVE:
            self.requeue(job, self.resumable)

    def requeue(self, job: Job[Request], states: Sequence[str], prepare: Callable[[], object] = lambda: None) -> None:
        """Queue a job in one of some states again.

        Args:
            job: as read. states: from which it may be queued.
            prepare: called before it can start.
        Raises:
            NotReadyError: it is in another state, or its request cannot be read. BusyError, QuotaError: as `submit`.
        """
        self._check_readable(job)
        row = self.row
        values = {"state": "queued", "problem": None, "ended": None}
        statement = update(row).where(row.id == job.id, row.state.in_(states)).values(values)
        with self._sessions.begin() as session:
            self._check_quota(session, job.user)
            if _num_changed(session, statement) == 0:
                state = session.scalar(select(row.state).where(row.id == job.id))
                allowed = f"only one that is {' or '.join(states)} can be queued again"
                raise NotReadyError(f"the {self.noun} is {state or 'deleted'}; {allowed}")
            prepare()
        self._wake.set()

    def record_progress(self, identity: str, done: int) -> None:
        """Record progress. Raises CancelledError if the job was stopped or deleted, or the server is closing."""
        if not self._update_leased(identity, state="running", done=done) or self.is_closing:
            raise CancelledError(f"the {self.noun} was stopped")

    @property
    def is_closing(self) -> bool:
        """True if the current step should stop."""
        return self._closing.is_set()

    def is_needed(self, identity: str) -> bool:
        """True unless the job was stopped, deleted or taken over a moment ago, or the server is closing."""
        if self.is_closing:
            return False
        if self._needed_until[0] == identity and time.monotonic() < self._needed_until[1]:
            return True  # steps ask thousands of times per second
        with self._sessions() as session:
            row = session.get(self.row, identity)
            is_active = row is not None and row.state in ACTIVE and row.owner == self._owner
        self._needed_until = identity if is_active else "", time.monotonic() + _CHECK_INTERVAL_S
        return is_active

    def _update_leased(self, identity: str, **values: Any) -> bool:
        """Change a running row whose lease is here. False if it is not any more."""
        return self._update(identity, ACTIVE, self.row.owner == self._owner, **values)

    def _update(self, identity: str, states: Sequence[str], *conditions: Any, **values: Any) -> bool:
        row = self.row
        statement = update(row).where(row.id == identity, row.state.in_(states), *conditions).values(**values)
        with self._sessions.begin() as session:
            return _num_changed(session, statement) > 0

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                identity = self._next()
                self._outage.report_recovered()
                if identity is not None:
                    with suppress(NotFoundError):  # deleted in the meantime
                        self._do(self.get(identity))
                    continue
            except Exception as error:  # the thread must survive an unavailable database
                self._outage.report_failure(error)
            self._wake.wait(timeout=_POLL_INTERVAL_S)
            self._wake.clear()

    def _next(self) -> str | None:
        """Take the lease of the next row without a live owner; None if there is none."""
        row = self.row
        columns = row.id, row.client, row.is_first, row.created, row.owner, row.heartbeat  # requests may be large
        query = select(*columns, epoch_s().label("now")).where(row.state.in_(ACTIVE))
        with self._sessions() as session:
            rows = [
                candidate
                for candidate in session.execute(query)
                if not self._is_leased_elsewhere(candidate.owner, candidate.heartbeat, candidate.now)
            ]
        owners = {candidate.id: candidate.owner for candidate in rows}
        waiting = [
            WaitingBake(candidate.id, candidate.client or "", bool(candidate.is_first), candidate.created)
            for candidate in rows
        ]
        self._timers = {
            candidate.id: self._timers[candidate.id] for candidate in waiting if candidate.id in self._timers
        }
        for waiting_job in self._fair_share.sort(waiting):
            previous_owner = owners[waiting_job.id]
            unchanged = or_(row.owner.is_(None), row.owner == previous_owner)
            started = func.coalesce(row.started, time.time())
            if self._update(waiting_job.id, ACTIVE, unchanged, owner=self._owner, heartbeat=epoch_s(), started=started):
                if previous_owner not in (None, self._owner):
                    log_taken_over(self.noun, waiting_job.id, str(previous_owner))
                self._fair_share.pick_next(waiting_job.client)
                return waiting_job.id
        return None

    def _renew_lease(self, identity: str, owner: str) -> None:
        self._update(identity, STATES, self.row.owner == owner, heartbeat=epoch_s())

    def _do(self, job: Job[Request]) -> None:
        """Run a step of one row; every error ends up in the row as a sentence."""
        folder = self.folder / job.id
        timer = self._timers.setdefault(job.id, StepTimer(self.step_s(job.request)))
        timer.start()
        try:
            self._check_readable(job)
            folder.mkdir(parents=True, exist_ok=True)
            claim(folder, self._owner)
            with LeaseRenewer(self._renew_lease, job.id, self._owner):
                done = self.step(job, timer)
            self._record_step(job, done)
        except CancelledError:  # closing, stopped, deleted, or taken over
            pass
        except OperationalError:  # the database is unavailable: the step runs again, and finds its results on the disk
            raise
        except Exception as error:
            if not isinstance(error, RelumeError | OSError):
                log.exception("%s %s failed", self.noun, job.id, extra={"fields": {self.noun.lower(): job.id}})
            if self._update_leased(job.id, state="failed", problem=make_problem(error).detail, ended=time.time()):
                self.on_failed(job)
        finally:
            has_lease = self._update(job.id, STATES, self.row.owner == self._owner, owner=None)
        if not self._exists(job.id):
            shutil.rmtree(folder, ignore_errors=True)
        elif not has_lease:
            log_lost_lease(self.noun, job.id)

    def _record_step(self, job: Job[Request], done: int) -> None:
        """Record a finished step; `done` steps are finished."""
        if done < job.total:
            self._update_leased(job.id, done=done)
        elif self._update_leased(job.id, done=done, state="ready", ended=time.time()):
            self.on_ready(job)

    def _exists(self, identity: str) -> bool:
        with self._sessions() as session:
            return session.get(self.row, identity) is not None

    def _is_leased_elsewhere(self, owner: str | None, heartbeat: float | None, now: float) -> bool:
        return owner not in (None, self._owner) and is_alive(str(owner), heartbeat or 0.0, now)


def _num_changed(session: Session, statement: Any) -> int:
    result = session.execute(statement, execution_options={"synchronize_session": False})
    return cast("CursorResult[Any]", result).rowcount


def _filtered(query: Select[Any], row: type[JobRow], job_filter: JobFilter) -> Select[Any]:
    """Filter a query of rows; requests are JSON without spaces."""
    if job_filter.state is not None:
        query = query.where(row.state == job_filter.state)
    if job_filter.user is not None:
        query = query.where(func.coalesce(row.client, "") == job_filter.user)
    for key, value in (("bake", job_filter.bake), ("name", job_filter.name)):
        if value is not None:
            json_fragment = f'"{key}":{json.dumps(value, ensure_ascii=False)}'
            query = query.where(row.request.contains(json_fragment, autoescape=True))
    return query
