"""Responses to calls with an idempotency key, which are replayed if the same call comes again.

Bounded: number per client and in total, size of each, and one day.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, and_, delete, func, or_, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, sessionmaker

from relume_server.persistence.tables import IdempotencyRow
from relume_worker.database.clock import epoch_s
from relume_worker.lease import may_run, new_owner

RETENTION_S = 86_400.0
ABANDONED_S = 3_600.0
"""A call that its server does not confirm for so long is not answered any more."""
MAX_EACH, MAX_ALL = 200, 10_000
MAX_BODY_BYTES = 64 * 1024


@dataclass(frozen=True)
class Answer:
    """A response; `body` is None if it was too large."""

    status: int
    location: str | None
    media_type: str | None
    body: bytes | None


@dataclass(frozen=True)
class EarlierCall:
    """An earlier call with the same key; `answer` is None while it is running."""

    digest: str
    answer: Answer | None


class IdempotencyStore:
    """Calls and their responses. Thread-safe."""

    def __init__(self, sessions: sessionmaker[Session]) -> None:
        self._sessions, self._owner = sessions, new_owner()

    def claim(self, client: str, key: str, digest: str) -> EarlierCall | None:
        """Claim a key for a call, or return the earlier call.

        Args:
            client: name of the caller. key: the caller's key. digest: digest of the whole request.
        """
        self._tidy(client)
        while True:
            with self._sessions() as session:
                existing = session.execute(select(IdempotencyRow, epoch_s()).where(_is(client, key))).one_or_none()
            if existing is None:
                if self._add(client, key, digest):
                    return None
                continue  # claimed at the same time
            row, now = existing
            if row.status is not None:
                answer = Answer(row.status, row.location, row.media_type, row.body)
                return EarlierCall(row.digest, answer)
            if may_run(row.owner) and now - row.created <= ABANDONED_S:
                return EarlierCall(row.digest, None)
            self._delete(_is(client, key), IdempotencyRow.owner == row.owner, IdempotencyRow.status.is_(None))

    def end(self, client: str, key: str, answer: Answer) -> None:
        """Store the response of a call that this server ran."""
        is_small = answer.body is not None and len(answer.body) <= MAX_BODY_BYTES
        values = {**vars(answer), "body": answer.body if is_small else None}
        with self._sessions.begin() as session:
            session.execute(update(IdempotencyRow).where(_is(client, key), self._has_own_claim).values(values))

    def drop(self, client: str, key: str) -> None:
        """Delete a call that this server began and that had no effect: it may be retried."""
        self._delete(_is(client, key), self._has_own_claim)

    @property
    def _has_own_claim(self) -> ColumnElement[bool]:
        return IdempotencyRow.owner == self._owner

    def _add(self, client: str, key: str, digest: str) -> bool:
        values = {"client": client, "key": key, "digest": digest, "owner": self._owner, "created": epoch_s()}
        try:
            with self._sessions.begin() as session:
                session.add(IdempotencyRow(**values))
        except IntegrityError:
            return False
        return True

    def _delete(self, *conditions: ColumnElement[bool]) -> int:
        with self._sessions.begin() as session:
            return cast("CursorResult[Any]", session.execute(delete(IdempotencyRow).where(*conditions))).rowcount

    def _tidy(self, client: str) -> None:
        """Delete old entries, and the oldest ones above the limits."""
        row, excess = IdempotencyRow, []
        with self._sessions() as session:
            for condition, limit in ((row.client == client, MAX_EACH), (row.key != "", MAX_ALL)):
                oldest = select(row.created).where(condition).order_by(row.created.desc()).offset(limit - 1).limit(1)
                if (created := session.scalar(oldest)) is not None:
                    excess.append(and_(condition, row.created <= created))
            is_old = row.created < epoch_s() - RETENTION_S
            has_any = session.scalar(select(func.count()).select_from(row).where(or_(is_old, *excess)))
        if has_any:
            self._delete(or_(is_old, *excess))


def _is(client: str, key: str) -> ColumnElement[bool]:
    return and_(IdempotencyRow.client == client, IdempotencyRow.key == key)
