"""Runs the jobs of all kinds: claims them, and gives each a thread, which waits for its steps in other processes.

Libraries for this (Celery, Dramatiq, RQ, Huey) run functions in separate processes behind a broker. Here the row is the
REST resource, clients are scheduled between the steps of one job, and a server needs nothing but its database; Dask
runs the steps, here or on other machines.
"""

from __future__ import annotations

import logging
import shutil
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from sqlalchemy.exc import OperationalError

from relume.core.errors import CancelledError, NotFoundError, RelumeError
from relume_worker.database.failures import DatabaseError
from relume_worker.jobs.claim import claim
from relume_worker.jobs.fair_share import FairShare, Waiting
from relume_worker.jobs.job import noun
from relume_worker.jobs.job_kind import JobKind
from relume_worker.jobs.job_ledger import JobLedger
from relume_worker.jobs.job_run import JobRun
from relume_worker.jobs.step import RunStep
from relume_worker.jobs.step_timer import StepTimer
from relume_worker.lease import HEARTBEAT_S, log_lost_lease

log = logging.getLogger(__name__)
POLL_INTERVAL_S = 2.0
MAX_RUNNING = 64
MAX_RUNNING_PER_CLIENT = 4
"""More would only wait for their turns, and could not run on another server; small jobs are not counted."""


class JobService:
    """Runs jobs; several services may share a database and a data directory.

    Args:
        ledger: of the jobs. run_step: runs a step in another process. num_slots: bulk steps that run at once.
        error_text: one sentence about an exception, for the job's row.
        weights: of clients, see `FairShare`.
    """

    def __init__(
        self,
        ledger: JobLedger,
        run_step: RunStep,
        num_slots: Callable[[], int],
        error_text: Callable[[Exception], str],
        weights: dict[str, float],
    ) -> None:
        self.ledger, self.run_step, self.num_slots, self._error_text = ledger, run_step, num_slots, error_text
        self._kinds: dict[str, JobKind[Any]] = {}
        self._fair_share = FairShare(weights)
        self._wake, self._closing, self._ended = threading.Event(), threading.Event(), threading.Event()
        self._outage = DatabaseError(log, "the queue of jobs cannot be read or written")
        self._runs: dict[str, tuple[Waiting, threading.Thread, JobRun[Any] | None]] = {}
        self._claimer = threading.Thread(target=self._claim_all, name="relume-jobs", daemon=True)
        self._renewer = threading.Thread(target=self._renew_leases, name="relume-leases", daemon=True)

    def add_kind(self, kind: JobKind[Any]) -> None:
        """Add a kind of jobs; before `start`."""
        self._kinds[kind.name] = kind

    def start(self) -> None:
        """Start claiming jobs: queued ones, and those that a dead service left."""
        self._claimer.start()
        self._renewer.start()

    def close(self) -> None:
        """Stop; unfinished jobs resume at the next start."""
        self._closing.set()
        self._wake.set()
        deadline = time.monotonic() + 30
        for thread in (self._claimer, *(thread for _, thread, _ in self._runs.copy().values())):
            if thread.is_alive():
                thread.join(max(0.0, deadline - time.monotonic()))
        self._ended.set()

    @property
    def is_closing(self) -> bool:
        """True if steps should stop."""
        return self._closing.is_set()

    def wake(self) -> None:
        """Look for new jobs now."""
        self._wake.set()

    def timer(self, identity: str) -> StepTimer | None:
        """Timer of a job that runs here."""
        run = self._runs.get(identity, (None, None, None))[2]
        return None if run is None else run.timer

    def _claim_all(self) -> None:
        while not self._closing.is_set():
            self._wake.clear()
            try:
                while self._claim_next():
                    pass
                self._outage.report_recovered()
            except Exception as error:  # the thread must survive an unavailable database
                self._outage.report_failure(error)
            self._wake.wait(timeout=POLL_INTERVAL_S)

    def _claim_next(self) -> bool:
        """Claim the next job, and start its thread. False if there is none, or enough are running."""
        running = self._runs.copy()
        for waiting in self._fair_share.sort(self.ledger.claimable(frozenset(running))):
            num_own = sum(run.client == waiting.client and not run.is_first for run, _, _ in running.values())
            has_room = waiting.is_first or (len(running) < MAX_RUNNING and num_own < MAX_RUNNING_PER_CLIENT)
            if self._closing.is_set() or not has_room or (row := self.ledger.claim(waiting.id)) is None:
                continue
            self._fair_share.pick_next(waiting.client)
            if (kind := self._kinds.get(row.kind)) is None:  # of a newer version
                self.ledger.release(row.id)
                continue
            thread = threading.Thread(target=self._run, args=(kind, waiting), name=f"relume-{row.kind}", daemon=True)
            self._runs[row.id] = waiting, thread, None
            thread.start()
            return True
        return False

    def _run(self, kind: JobKind[Any], waiting: Waiting) -> None:
        """Run one job; every error ends up in its row as a sentence."""
        try:
            with suppress(NotFoundError):  # deleted in the meantime
                job = kind.get(waiting.id)
                is_first, step_s = kind.is_first(job.request), kind.step_s(job.request)
                run: JobRun[Any] = JobRun(self, kind.name, job, kind.folder / job.id, is_first=is_first, step_s=step_s)
                self._runs[waiting.id] = waiting, threading.current_thread(), run
                self._run_steps(kind, run)
        except Exception as error:  # the database is unavailable: the job is claimed again, and finds its results
            self._outage.report_failure(error)
        finally:
            del self._runs[waiting.id]
            self._wake.set()

    def _run_steps(self, kind: JobKind[Any], run: JobRun[Any]) -> None:
        job, ledger = run.job, self.ledger
        try:
            kind.check_readable(job)
            run.folder.mkdir(parents=True, exist_ok=True)
            claim(run.folder, ledger.owner)
            kind.run(run)
            if ledger.update_leased(job.id, done=job.total, state="ready", ended=time.time()):
                kind.on_ready(job)
        except CancelledError:  # closing, stopped, deleted, or taken over
            pass
        except OperationalError:
            raise
        except Exception as error:
            if not isinstance(error, RelumeError | OSError):
                log.exception("%s %s failed", noun(kind.name), job.id, extra={"fields": {kind.name: job.id}})
            if ledger.update_leased(job.id, state="failed", problem=self._error_text(error), ended=time.time()):
                kind.on_failed(job)
        finally:
            has_lease = ledger.release(job.id)
        if not ledger.exists(job.id):
            shutil.rmtree(run.folder, ignore_errors=True)
        elif not has_lease:
            log_lost_lease(noun(kind.name), job.id)

    def _renew_leases(self) -> None:
        while not self._ended.wait(HEARTBEAT_S):
            try:
                if self._runs:
                    self.ledger.renew_leases()
            except Exception as error:  # a short outage costs no lease
                self._outage.report_failure(error)
