"""Rows of jobs: states, quotas, leases.

    queued ──claim──▶ running ──▶ ready
      ▲                 │ └─────▶ failed     a failed or canceled job is queued again; its finished steps stay
      └──requeue────────┴───────▶ canceled

Every change is one statement that names the state it expects, so that of two racing processes only one succeeds. Only
the owner of a row's lease changes its state, its files and its quota. A service that was suspended for longer than the
lease notices at its next statement on the row, and drops its work.
"""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, cast

from sqlalchemy import CursorResult, Select, and_, delete, func, or_, select, update
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import NotFoundError
from relume_worker.database.clock import epoch_s
from relume_worker.database.models import JobRow, TaskRow
from relume_worker.job_state import ACTIVE_STATES, JobState
from relume_worker.jobs.fair_share import Waiting
from relume_worker.jobs.job import BAKE, BusyError, JobFilter, NotReadyError, Quota, QuotaError, lane, noun
from relume_worker.lease import is_alive, log_taken_over

HOLDS_S = 0.1
"""Age of an answer of `holds_lease`; steps ask thousands of times per second."""


class JobLedger:
    """Jobs of all kinds in the database.

    Args:
        sessions: of the database. quota: limits of each kind. owner: of leases that this ledger takes.
    """

    def __init__(self, sessions: sessionmaker[Session], quota: Quota, owner: str) -> None:
        self.sessions, self.quota, self.owner = sessions, quota, owner
        self._leased, self._leased_until_s, self._asking = frozenset[str](), 0.0, threading.Lock()

    def add(self, row: JobRow, prepare: Callable[[], object]) -> None:
        """Queue a job.

        Args:
            row: with id, kind, request, client and priority. prepare: called before it can start.
        Raises:
            BusyError, QuotaError: the limit of all jobs of this kind, or of this client, is reached.
        """
        with self.sessions.begin() as session:
            self._check_quota(session, row.kind, row.client or "")
            prepare()
            row.state, row.created = "queued", time.time()
            session.add(row)

    def _check_quota(self, session: Session, kind: str, client: str) -> None:
        quota = self.quota
        active = JobRow.kind == kind, JobRow.state.in_(ACTIVE_STATES)
        clients = session.scalars(select(JobRow.client).where(*active)).all()
        if len(clients) >= quota.max_total:
            text = f"the limit of {quota.max_total} unfinished {noun(kind)}s is reached; try again later"
            raise BusyError(f"{text} (RELUME_MAX_QUEUED)")
        if sum((queued_client or "") == client for queued_client in clients) >= quota.max_per_client:
            text = f"you have reached the limit of {quota.max_per_client} unfinished {noun(kind)}s; wait, or stop one"
            raise QuotaError(f"{text} (RELUME_MAX_QUEUED_PER_USER)")

    def get(self, kind: str, identity: str) -> JobRow:
        """Return the row of a job. Raises NotFoundError."""
        with self.sessions() as session:
            row = session.get(JobRow, identity)
        if row is None or row.kind != kind:
            raise NotFoundError(f"there is no {noun(kind)} {identity[:40]}; start one first")
        return row

    def exists(self, identity: str) -> bool:
        """True unless the job was deleted."""
        with self.sessions() as session:
            return session.get(JobRow, identity) is not None

    def page(
        self, kind: str, job_filter: JobFilter, limit: int, after: tuple[float, str] | None, *, newest_first: bool
    ) -> Sequence[JobRow]:
        """List rows of a kind, newest first or last.

        Args:
            kind: of the jobs. job_filter: of the list. limit: maximum number.
            after: time of creation and id of the row before the page; None: start with the first.
            newest_first: order.
        """
        query = _filtered(select(JobRow).where(JobRow.kind == kind), job_filter).limit(limit)
        created = JobRow.created.desc() if newest_first else JobRow.created
        if after is not None:
            is_later = JobRow.created < after[0] if newest_first else JobRow.created > after[0]
            query = query.where(or_(is_later, and_(JobRow.created == after[0], JobRow.id > after[1])))
        with self.sessions() as session:
            return session.scalars(query.order_by(created, JobRow.id)).all()

    def referencing(self, kind: str, text: str) -> list[str]:
        """Ids of queued and running jobs whose request contains a text, oldest first."""
        contains = JobRow.request.contains(text, autoescape=True)
        query = select(JobRow.id).where(JobRow.kind == kind, JobRow.state.in_(ACTIVE_STATES), contains)
        with self.sessions() as session:
            return list(session.scalars(query.order_by(JobRow.created)))

    def delete(self, identities: Collection[str]) -> None:
        """Delete jobs in any state; whoever runs them notices."""
        with self.sessions.begin() as session:
            session.execute(delete(TaskRow).where(TaskRow.bake_id.in_(identities)))
            session.execute(delete(JobRow).where(JobRow.id.in_(identities)))

    def requeue(self, row: JobRow, states: Sequence[str], prepare: Callable[[], object]) -> None:
        """Queue a job in one of some states again.

        Args:
            row: as read. states: from which it may be queued. prepare: called before it can start.
        Raises:
            NotReadyError: it is in another state. BusyError, QuotaError: as `add`.
        """
        with self.sessions.begin() as session:
            self._check_quota(session, row.kind, row.client or "")
            if not queue_again(session, row.id, states):
                state = session.scalar(select(JobRow.state).where(JobRow.id == row.id))
                allowed = f"only one that is {' or '.join(states)} can be queued again"
                raise NotReadyError(f"the {noun(row.kind)} is {state or 'deleted'}; {allowed}")
            prepare()

    def cancel(self, identity: str) -> bool:
        """Cancel a queued or running job; whoever runs it notices. False if it is neither."""
        is_active = JobRow.id == identity, JobRow.state.in_(ACTIVE_STATES)
        return self._update(*is_active, state="canceled", ended=time.time(), seconds_left=None, phase=None)

    # leases

    def claimable(self, kinds: Collection[str], running: Collection[str] = ()) -> list[Waiting]:
        """Jobs without a live owner: queued, or left by a dead one.

        Args:
            kinds: kinds of the jobs. running: those that this service runs already.
        """
        queued = func.coalesce(JobRow.queued, JobRow.created).label("queued")
        columns = JobRow.id, JobRow.kind, JobRow.client, JobRow.is_first, JobRow.priority
        leases = JobRow.owner, JobRow.heartbeat, epoch_s().label("now")
        query = select(*columns, *leases, queued)  # without requests, which may be large
        with self.sessions() as session:
            rows = session.execute(query.where(JobRow.state.in_(ACTIVE_STATES), JobRow.kind.in_(kinds))).all()
        free, num_elsewhere = [], Counter[tuple[str, str]]()
        for row in rows:
            client, row_lane = row.client or "", lane(row.kind, is_first=bool(row.is_first))
            if self._is_leased(row):
                num_elsewhere[client, row_lane] += 1
            elif row.id not in running:
                free.append((row, client, row_lane))
        return [
            Waiting(
                row.id,
                client,
                bool(row.is_first),
                row.queued,
                num_elsewhere[client, row_lane],
                row.kind,
                row_lane,
                row.priority,
            )
            for row, client, row_lane in free
        ]

    def claim(self, identity: str) -> bool:
        """Take the lease of a job, and set it running. False if another service has it, or the job is not active."""
        query = select(JobRow.kind, JobRow.owner, JobRow.heartbeat, epoch_s().label("now")).where(JobRow.id == identity)
        with self.sessions() as session:
            row = session.execute(query).first()
        if row is None or self._is_leased(row):
            return False
        is_unchanged = or_(JobRow.owner.is_(None), JobRow.owner == row.owner)
        conditions = JobRow.id == identity, JobRow.state.in_(ACTIVE_STATES), is_unchanged
        lease = {"owner": self.owner, "heartbeat": epoch_s(), "started": func.coalesce(JobRow.started, time.time())}
        if not self._update(*conditions, state="running", phase=None, seconds_left=None, **lease):
            return False
        if row.owner not in (None, self.owner):
            log_taken_over(noun(row.kind), identity, row.owner)
        return True

    def _is_leased(self, row: Any) -> bool:
        """True if another live service has the lease."""
        return row.owner not in (None, self.owner) and is_alive(row.owner, row.heartbeat or 0.0, row.now)

    def renew_leases(self) -> None:
        """Renew all leases of this service."""
        self._update(JobRow.owner == self.owner, heartbeat=epoch_s())

    def renew_lease(self, identity: str) -> bool:
        """Renew the lease of a job in any state. False if it is not here any more."""
        with self.sessions.begin() as session:
            return self._renew_until_commit(session, identity)

    def _renew_until_commit(self, session: Session, identity: str) -> bool:
        """Renew a lease; true if this owner holds it until the transaction ends."""
        is_owner = JobRow.id == identity, JobRow.owner == self.owner
        return num_changed(session, update(JobRow).where(*is_owner).values(heartbeat=epoch_s())) == 1

    def finish(self, identity: str, state: JobState, **values: Any) -> bool:
        """Set the final state of an active job whose lease is here, and other columns. False if it is not any more."""
        final = {"state": state, "ended": time.time(), "problem": None, "seconds_left": None, "phase": None}
        return self.update_leased(identity, **{**final, **values})

    def update_leased(self, identity: str, **values: Any) -> bool:
        """Change an active row whose lease is here. False if it is not any more."""
        return self._update(
            JobRow.id == identity, JobRow.state.in_(ACTIVE_STATES), JobRow.owner == self.owner, **values
        )

    def holds_lease(self, identity: str) -> bool:
        """True if the job was active, and its lease here, at most `HOLDS_S` ago; all jobs share one statement."""
        asked_s, is_known = time.monotonic(), identity in self._leased
        if is_known and asked_s < self._leased_until_s:
            return True
        is_only = self._asking.acquire(blocking=False)
        try:
            if is_known and not is_only:  # another thread asks for all
                return True
            with self.sessions() as session:
                query = select(JobRow.id).where(JobRow.owner == self.owner, JobRow.state.in_(ACTIVE_STATES))
                self._leased = frozenset(session.scalars(query))
            self._leased_until_s = asked_s + HOLDS_S
        finally:
            if is_only:
                self._asking.release()
        return identity in self._leased

    def release(self, identity: str) -> bool:
        """Give up a lease. False if it was lost before."""
        return self._update(JobRow.id == identity, JobRow.owner == self.owner, owner=None)

    def _update(self, *conditions: Any, **values: Any) -> bool:
        with self.sessions.begin() as session:
            return num_changed(session, update(JobRow).where(*conditions).values(**values)) > 0


def count_jobs(sessions: sessionmaker[Session], kinds: Sequence[str]) -> Mapping[tuple[str, str], int]:
    """Count bakes, and jobs of some kinds, by kind and state, "queued" or "running"."""
    counts: dict[tuple[str, str], int] = {(kind, state): 0 for kind in (BAKE, *kinds) for state in ACTIVE_STATES}
    columns = JobRow.kind, JobRow.state
    jobs = select(*columns, func.count()).where(JobRow.state.in_(ACTIVE_STATES)).group_by(*columns)
    with sessions() as session:
        counts.update({(kind, state): num for kind, state, num in session.execute(jobs)})
    return counts


def queue_again(session: Session, identity: str, states: Sequence[str], **values: Any) -> bool:
    """Queue a job in one of some states again.

    Args:
        session: in a transaction. identity: id of the job. states: from which it may be queued.
        values: other columns to change.
    Returns:
        False if it is in another state, or deleted.
    """
    waiting = {"state": "queued", "queued": time.time(), **dict.fromkeys(("problem", "ended", "phase", "seconds_left"))}
    statement = update(JobRow).where(JobRow.id == identity, JobRow.state.in_(states)).values({**waiting, **values})
    return num_changed(session, statement) == 1


def num_changed(session: Session, statement: Any) -> int:
    """Execute a statement, and return the number of changed rows."""
    result = session.execute(statement, execution_options={"synchronize_session": False})
    return cast("CursorResult[Any]", result).rowcount


def _filtered(query: Select[Any], job_filter: JobFilter) -> Select[Any]:
    """Filter a query of rows; requests are JSON without spaces."""
    if job_filter.state is not None:
        query = query.where(JobRow.state == job_filter.state)
    if job_filter.user is not None:
        query = query.where(func.coalesce(JobRow.client, "") == job_filter.user)
    for key, value in (("bake", job_filter.bake), ("name", job_filter.name)):
        if value is not None:
            json_fragment = f'"{key}":{json.dumps(value, ensure_ascii=False)}'
            query = query.where(JobRow.request.contains(json_fragment, autoescape=True))
    return query
