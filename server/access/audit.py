"""The audit: a line for each change, login and refusal, who and when, in the database. Lines are only added; the oldest
go.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

from sqlalchemy import delete, select
from sqlalchemy.orm import Session, sessionmaker

from server.access.roles import Caller
from server.access.tables import AuditRow
from server.logs.context import REQUEST
from worker.database.faults import AWAY, told

log = logging.getLogger(__name__)
_TRIM_EVERY = 100
_REFUSED = (401, 403)
_REFUSED_SHARE = 10
MAX_LISTED = 1_000


@dataclass(frozen=True)
class Change:
    """What somebody has done.

    Attributes:
        who: name, or address where nobody logs in. role: that they had. address: where they are.
        what: method and path, or in words. object: what was made, or what the path names. status: of the answer.
        request: id of the request.
    """

    who: str
    role: str
    address: str
    what: str
    object: str
    status: int
    request: str

    @classmethod
    def by(cls, caller: Caller, what: str, thing: str, status: int) -> Change:
        """A change that a caller makes in the request at hand."""
        role, address = caller.role.word, caller.address[:64]
        return cls(caller.shown[:80], role, address, what[:200], thing[:500], status, REQUEST.get())


@dataclass(frozen=True)
class Entry(Change):
    """A line; `number` counts up, `at` is in seconds since 1970."""

    number: int
    at: float


class Audit:
    """Lines of the audit, the newest `most` of them; may be used from any thread.

    Of refusals a tenth as many, beside them: whoever tries to get in again and again pushes no change out.
    """

    def __init__(self, sessions: sessionmaker[Session], most: int) -> None:
        self._sessions, self._most = sessions, most
        self._until_trim = 0

    def add(self, change: Change) -> None:
        """Write a line; where the database is away the log has it instead."""
        try:
            with self._sessions.begin() as session:
                session.add(AuditRow(at=time.time(), **asdict(change)))
            self._until_trim -= 1
            if self._until_trim < 0:
                self._until_trim = _TRIM_EVERY
                self._trim()
        except AWAY as error:
            log.error("a line of the audit could not be kept (%s): %s", told(error), change)

    def list(self, most: int = 100, before: int | None = None, who: str | None = None) -> Sequence[Entry]:
        """Lines, newest first.

        Args:
            most: how many. before: only older ones than this number. who: only of this name.
        """
        query = select(AuditRow).order_by(AuditRow.number.desc()).limit(min(most, MAX_LISTED))
        if before is not None:
            query = query.where(AuditRow.number < before)
        if who is not None:
            query = query.where(AuditRow.who == who)
        with self._sessions() as session:
            return [
                Entry(**{field.name: getattr(row, field.name) for field in fields(Entry)})
                for row in session.scalars(query)
            ]

    def _trim(self) -> None:
        with self._sessions.begin() as session:
            for are, most in (
                (AuditRow.status.not_in(_REFUSED), self._most),
                (AuditRow.status.in_(_REFUSED), max(1, self._most // _REFUSED_SHARE)),
            ):
                numbers = select(AuditRow.number).where(are).order_by(AuditRow.number.desc())
                oldest = session.scalar(numbers.offset(most - 1).limit(1))
                if oldest is not None:
                    session.execute(delete(AuditRow).where(are, AuditRow.number < oldest))
