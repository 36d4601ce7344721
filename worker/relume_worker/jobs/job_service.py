"""Runs the jobs of all kinds: claims them, and gives each a thread, which waits for its steps in other processes.

Libraries for this (Celery, Dramatiq, RQ, Huey) run functions in separate processes behind a broker. Here the row is the
REST resource, clients are scheduled between the steps of one job, and a server needs nothing but its database; Dask
runs the steps, here or on other machines.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

from sqlalchemy.exc import OperationalError

from relume.core.errors import CancelledError, RelumeError
from relume_worker.database.failures import DatabaseError
from relume_worker.database.retry import Given, Result, with_retry
from relume_worker.jobs.fair_share import FairShare, Waiting
from relume_worker.jobs.job import noun
from relume_worker.jobs.job_ledger import JobLedger
from relume_worker.jobs.kind import Kind
from relume_worker.jobs.step import RunStep
from relume_worker.lease import RENEW_S, log_lost_lease

log = logging.getLogger(__name__)
POLL_INTERVAL_S = 1.0
CLOSE_S = 30.0


class JobService:
    """Runs jobs; several services may share a database and a data directory.

    Args:
        ledger: of the jobs. weights: of clients, see `FairShare`.
    """

    run_step: RunStep
    num_slots: Callable[[], int]
    describe: Callable[[Exception], str]

    def __init__(self, ledger: JobLedger, weights: Mapping[str, float]) -> None:
        self.ledger = ledger
        self._kinds: dict[str, Kind] = {}
        self._fair_shares = defaultdict[str, FairShare](lambda: FairShare(weights))  # by lane
        self._wake, self._closing, self._ended = threading.Event(), threading.Event(), threading.Event()
        self._outage = DatabaseError(log, "the queue of jobs cannot be read or written")
        self._run_outage = DatabaseError(log, "a job cannot be recorded")
        self._lease_outage = DatabaseError(log, "the leases of jobs cannot be renewed")
        self._runs: dict[str, tuple[Waiting, threading.Thread]] = {}
        self._claimer = threading.Thread(target=self._claim_all, name="relume-jobs", daemon=True)
        self._renewer = threading.Thread(target=self._renew_leases, name="relume-leases", daemon=True)

    def add_kind(self, kind: Kind) -> None:
        """Add a kind of jobs; before `start`."""
        self._kinds[kind.name] = kind

    def use_steps(self, run_step: RunStep, num_slots: Callable[[], int], describe: Callable[[Exception], str]) -> None:
        """Set what kinds with steps need, before `start`.

        Args:
            run_step: runs a step in another process. num_slots: number of bulk steps that run at once.
            describe: returns one sentence about an exception, for the job's row.
        """
        self.run_step, self.num_slots, self.describe = run_step, num_slots, describe

    def start(self) -> None:
        """Start claiming jobs: queued ones, and those that a dead service left."""
        self._claimer.start()
        self._renewer.start()

    def close(self) -> None:
        """Stop; unfinished jobs resume at the next start."""
        self._closing.set()
        self._wake.set()
        deadline = time.monotonic() + CLOSE_S
        for thread in (self._claimer, *(thread for _, thread in self._runs.copy().values())):
            if thread.is_alive():
                thread.join(max(0.0, deadline - time.monotonic()))
        self._ended.set()
        if self._renewer.is_alive():
            self._renewer.join(1.0)

    @property
    def is_closing(self) -> bool:
        """True if steps should stop."""
        return self._closing.is_set()

    def wake(self) -> None:
        """Look for new jobs now."""
        self._wake.set()

    def _claim_all(self) -> None:
        while not self._closing.is_set():
            self._wake.clear()
            try:
                while self._claim_next():
                    pass
                if not self._closing.is_set():  # else nothing was tried
                    self._outage.report_recovered()
            except Exception as error:  # the thread must survive an unavailable database
                self._outage.report_failure(error)
            self._wake.wait(timeout=POLL_INTERVAL_S)

    def _claim_next(self) -> bool:
        """Claim the next job of each lane, and start its thread. False if there is none, or enough are running.

        Raises:
            The error of a lane; the others continue.
        """
        running = [work for work, _ in self._runs.copy().values()]
        lanes, failure, has_claimed = defaultdict[str, list[Waiting]](list), None, False
        for work in self.ledger.claimable(self._kinds, {work.id for work in running}):
            lanes[work.lane].append(work)
        for lane, waiting in lanes.items():
            try:
                has_claimed |= self._claim_in_lane(lane, waiting, [work for work in running if work.lane == lane])
            except Exception as error:
                failure = error
        if failure is not None:
            raise failure
        return has_claimed

    def _claim_in_lane(self, lane: str, waiting: Sequence[Waiting], running: Sequence[Waiting]) -> bool:
        for work in self._fair_shares[lane].sort(waiting):
            kind = self._kinds[work.kind]
            if self._closing.is_set() or not kind.has_room(work, running):
                continue
            try:
                if not self.ledger.claim(work.id):
                    continue
            except Exception as error:
                kind.on_blocked(work.id, error)
                raise
            self._fair_shares[lane].pick_next(work.client)
            thread = threading.Thread(target=self._run, args=(kind, work), name=f"relume-{kind.name}", daemon=True)
            self._runs[work.id] = work, thread
            thread.start()
            return True
        return False

    def _run(self, kind: Kind, work: Waiting) -> None:
        """Run one job; every error ends up in its row as a sentence."""
        try:
            self._perform(kind, work)
            self._run_outage.report_recovered()
        except Exception as error:  # of the database: the job is claimed again, and finds its results
            self._run_outage.report_failure(error)
            with suppress(Exception):  # perhaps it cannot be read, either
                kind.on_blocked(work.id, error)
            self._closing.wait(POLL_INTERVAL_S)
        finally:
            del self._runs[work.id]
            self._wake.set()

    def _perform(self, kind: Kind, work: Waiting) -> None:
        identity, ledger = work.id, self.ledger
        try:
            columns = kind.perform(work)
            if self._call(ledger.finish, identity, "ready", **columns):
                kind.on_ready(identity)
        except CancelledError:  # closing, canceled, deleted, or taken over
            pass
        except OperationalError:
            raise
        except Exception as error:  # a defect must not end the service
            if self._call(ledger.exists, identity):  # otherwise deleted meanwhile, with its files
                self._fail(kind, identity, error)
        finally:
            has_lease = self._call(ledger.release, identity)
        if not has_lease and self._call(ledger.exists, identity):
            log_lost_lease(noun(kind.name), identity)
        elif not has_lease:
            kind.on_deleted(identity)

    def _fail(self, kind: Kind, identity: str, error: Exception) -> None:
        if not isinstance(error, RelumeError | OSError):
            log.exception("%s %s failed", noun(kind.name), identity, extra={"fields": {kind.name: identity}})
        if self._call(self.ledger.finish, identity, "failed", problem=kind.error_text(identity, error)):
            kind.on_failed(identity)

    def _call(self, call: Callable[Given, Result], *args: Given.args, **kwargs: Given.kwargs) -> Result:
        """Call the ledger; an outage delays a job, and does not end it."""
        return with_retry(self._closing.is_set, call, *args, **kwargs)

    def _renew_leases(self) -> None:
        while not self._ended.wait(RENEW_S):
            try:
                if self._runs:
                    self.ledger.renew_leases()
                    self._lease_outage.report_recovered()
            except Exception as error:  # a short outage costs no lease
                self._lease_outage.report_failure(error)
