"""The audit: a row per change, login and refusal, with user and time. Rows are only added; the oldest are deleted."""

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
    """A change that a user made.

    Attributes:
        who: name, or address without login. role: role of the user at that time. address: address of the client.
        what: method and path, or words. object: created, or named by the path. status: status of the response.
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
        """Make the change of a caller in the current request."""
        role, address = caller.role.label, caller.address[:64]
        return cls(caller.display_name[:80], role, address, action[:200], target[:500], status, REQUEST.get())


@dataclass(frozen=True)
class Entry(Change):
    """A row; `number` counts up, `at` is in seconds since 1970."""

    number: int
    at: float


class Audit:
    """The newest `max_lines` rows of the audit. Thread-safe.

    Refusals are limited separately, to a tenth of it, so that repeated login attempts cannot displace changes.
    """

    def __init__(self, sessions: sessionmaker[Session], max_lines: int) -> None:
        self._sessions, self._max_lines = sessions, max_lines
        self._until_trim = 0

    def add(self, change: Change) -> None:
        """Add a row; if the database is unavailable, the log gets it instead."""
        try:
            with self._sessions.begin() as session:
                session.add(AuditRow(at=time.time(), **asdict(change)))
            self._until_trim -= 1
            if self._until_trim < 0:
                self._until_trim = _TRIM_EVERY
                self._trim()
        except DATABASE_ERRORS as error:
            log.error("a row of the audit could not be stored (%s): %s", describe_error(error), change)

    def list(self, limit: int = 100, before: int | None = None, actor: str | None = None) -> Sequence[Entry]:
        """List rows, newest first.

        Args:
            limit: maximum number. before: only rows with a smaller number. actor: only rows of this user.
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
