"""Rows of jobs: states, quotas, leases.

Only the owner of a row's lease changes its state, its files and its quota. A service that was suspended for longer than
the lease notices at its next statement on the row, and drops its work.
"""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

from sqlalchemy import CursorResult, Select, and_, func, or_, select, update
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import NotFoundError
from relume_worker.database.clock import epoch_s
from relume_worker.database.models import BakeRow, JobRow
from relume_worker.job_state import ACTIVE_STATES
from relume_worker.jobs.fair_share import Waiting
from relume_worker.jobs.job import BusyError, JobFilter, NotReadyError, Quota, QuotaError, noun
from relume_worker.lease import is_alive, log_taken_over

HOLDS_S = 0.1
"""Age of an answer of `holds_lease`; steps ask thousands of times per second."""


class JobLedger:
    """Jobs of all kinds in the database.

    Args:
        sessions: of the database. quota: limits of each kind. owner: of leases that this process takes.
    """

    def __init__(self, sessions: sessionmaker[Session], quota: Quota, owner: str) -> None:
        self._sessions, self._quota, self.owner = sessions, quota, owner
        self._leased, self._leased_until_s, self._asking = frozenset[str](), 0.0, threading.Lock()

    def add(self, row: JobRow, prepare: Callable[[], object]) -> None:
        """Queue a job.

        Args:
            row: with id, kind, request, client and priority. prepare: called before it can start.
        Raises:
            BusyError, QuotaError: the limit of all jobs of this kind, or of this client, is reached.
        """
        with self._sessions.begin() as session:
            self._check_quota(session, row.kind, row.client or "")
            prepare()
            row.state, row.created = "queued", time.time()
            session.add(row)

    def _check_quota(self, session: Session, kind: str, client: str) -> None:
        quota = self._quota
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
        with self._sessions() as session:
            row = session.get(JobRow, identity)
        if row is None or row.kind != kind:
            raise NotFoundError(f"there is no {noun(kind)} {identity[:40]}; start one first")
        return row

    def exists(self, identity: str) -> bool:
        """True unless the job was deleted."""
        with self._sessions() as session:
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
        with self._sessions() as session:
            return session.scalars(query.order_by(created, JobRow.id)).all()

    def referencing(self, kind: str, text: str) -> list[str]:
        """Ids of queued and running jobs whose request contains a text, oldest first."""
        contains = JobRow.request.contains(text, autoescape=True)
        query = select(JobRow.id).where(JobRow.kind == kind, JobRow.state.in_(ACTIVE_STATES), contains)
        with self._sessions() as session:
            return list(session.scalars(query.order_by(JobRow.created)))

    def delete(self, identity: str) -> None:
        """Delete a row; whoever runs the job notices."""
        with self._sessions.begin() as session:
            if (row := session.get(JobRow, identity)) is not None:
                session.delete(row)

    def requeue(self, row: JobRow, states: Sequence[str], prepare: Callable[[], object]) -> None:
        """Queue a job in one of some states again.

        Args:
            row: as read. states: from which it may be queued. prepare: called before it can start.
        Raises:
            NotReadyError: it is in another state. BusyError, QuotaError: as `add`.
        """
        values = {"state": "queued", "problem": None, "ended": None}
        statement = update(JobRow).where(JobRow.id == row.id, JobRow.state.in_(states)).values(values)
        with self._sessions.begin() as session:
            self._check_quota(session, row.kind, row.client or "")
            if _num_changed(session, statement) == 0:
                state = session.scalar(select(JobRow.state).where(JobRow.id == row.id))
                allowed = f"only one that is {' or '.join(states)} can be queued again"
                raise NotReadyError(f"the {noun(row.kind)} is {state or 'deleted'}; {allowed}")
            prepare()

    def stop(self, identity: str) -> None:
        """Stop a queued or running job."""
        self._update(JobRow.id == identity, JobRow.state.in_(ACTIVE_STATES), state="canceled", ended=time.time())

    # leases

    def claimable(self, running: frozenset[str]) -> list[Waiting]:
        """Jobs without a live owner. running: those that this service runs already."""
        columns = JobRow.id, JobRow.client, JobRow.is_first, JobRow.created, JobRow.owner, JobRow.heartbeat
        query = select(*columns, epoch_s().label("now")).where(JobRow.state.in_(ACTIVE_STATES))  # requests may be large
        with self._sessions() as session:
            rows = [(row, self._is_leased(row)) for row in session.execute(query)]
        num_elsewhere = Counter(row.client or "" for row, is_leased in rows if is_leased)
        return [
            Waiting(row.id, client := row.client or "", bool(row.is_first), row.created, num_elsewhere[client])
            for row, is_leased in rows
            if not is_leased and row.id not in running
        ]

    def claim(self, identity: str) -> JobRow | None:
        """Take the lease of a job; None if another service was faster, or the job is not active any more."""
        query = select(JobRow, epoch_s().label("now")).where(JobRow.id == identity)
        with self._sessions() as session:
            row_and_time = session.execute(query).first()
        if row_and_time is None or self._is_leased(row_and_time[0], row_and_time[1]):
            return None
        row = row_and_time[0]
        is_unchanged = or_(JobRow.owner.is_(None), JobRow.owner == row.owner)
        started = func.coalesce(JobRow.started, time.time())
        conditions = JobRow.id == identity, JobRow.state.in_(ACTIVE_STATES), is_unchanged
        if not self._update(*conditions, owner=self.owner, heartbeat=epoch_s(), started=started):
            return None
        if row.owner not in (None, self.owner):
            log_taken_over(noun(row.kind), identity, str(row.owner))
        return row

    def _is_leased(self, row: Any, now: float | None = None) -> bool:
        """True if another live service has the lease."""
        is_other = row.owner not in (None, self.owner)
        return is_other and is_alive(str(row.owner), row.heartbeat or 0.0, row.now if now is None else now)

    def renew_leases(self) -> None:
        """Renew all leases of this service."""
        self._update(JobRow.owner == self.owner, heartbeat=epoch_s())

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
            with self._sessions() as session:
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
        with self._sessions.begin() as session:
            return _num_changed(session, update(JobRow).where(*conditions).values(**values)) > 0


def count_jobs(sessions: sessionmaker[Session], kinds: Sequence[str]) -> Mapping[tuple[str, str], int]:
    """Count bakes, and jobs of some kinds, by kind and state, "queued" or "running"."""
    counts: dict[tuple[str, str], int] = {(kind, state): 0 for kind in ("bake", *kinds) for state in ACTIVE_STATES}
    columns = JobRow.kind, JobRow.state
    jobs = select(*columns, func.count()).where(JobRow.state.in_(ACTIVE_STATES)).group_by(*columns)
    bakes = select(BakeRow.state, func.count()).where(BakeRow.state.in_(ACTIVE_STATES)).group_by(BakeRow.state)
    with sessions() as session:
        counts.update({(kind, state): num for kind, state, num in session.execute(jobs)})
        counts.update({("bake", state): num for state, num in session.execute(bakes)})
    return counts


def _num_changed(session: Session, statement: Any) -> int:
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
