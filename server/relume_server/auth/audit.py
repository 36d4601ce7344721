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

from relume_server.auth.roles import Caller
from relume_server.auth.tables import AuditRow
from relume_server.telemetry.logs.context import REQUEST
from relume_worker.database.failures import DATABASE_ERRORS, describe_error

log = logging.getLogger(__name__)
_TRIM_EVERY = 100
_REFUSED = (401, 403)
_REFUSED_DIVISOR = 10
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
    def by(cls, caller: Caller, action: str, target: str, status: int) -> Change:
        """A change that a caller makes in the request at hand."""
        role, address = caller.role.label, caller.address[:64]
        return cls(caller.display_name[:80], role, address, action[:200], target[:500], status, REQUEST.get())


@dataclass(frozen=True)
class Entry(Change):
    """A line; `number` counts up, `at` is in seconds since 1970."""

    number: int
    at: float


class Audit:
    """Lines of the audit, the newest `max_lines` of them; may be used from any thread.

    Of refusals a tenth as many, beside them: whoever tries to get in again and again pushes no change out.
    """

    def __init__(self, sessions: sessionmaker[Session], max_lines: int) -> None:
        self._sessions, self._max_lines = sessions, max_lines
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
        except DATABASE_ERRORS as error:
            log.error("a line of the audit could not be kept (%s): %s", describe_error(error), change)

    def list(self, limit: int = 100, before: int | None = None, actor: str | None = None) -> Sequence[Entry]:
        """Lines, newest first.

        Args:
            limit: how many. before: only older ones than this number. actor: only of this name.
        """
        query = select(AuditRow).order_by(AuditRow.number.desc()).limit(min(limit, MAX_LISTED))
        if before is not None:
            query = query.where(AuditRow.number < before)
        if actor is not None:
            query = query.where(AuditRow.who == actor)
        with self._sessions() as session:
            return [
                Entry(**{field.name: getattr(row, field.name) for field in fields(Entry)})
                for row in session.scalars(query)
            ]

    def _trim(self) -> None:
        with self._sessions.begin() as session:
            for condition, limit in (
                (AuditRow.status.not_in(_REFUSED), self._max_lines),
                (AuditRow.status.in_(_REFUSED), max(1, self._max_lines // _REFUSED_DIVISOR)),
            ):
                numbers = select(AuditRow.number).where(condition).order_by(AuditRow.number.desc())
                oldest = session.scalar(numbers.offset(limit - 1).limit(1))
                if oldest is not None:
                    session.execute(delete(AuditRow).where(condition, AuditRow.number < oldest))
