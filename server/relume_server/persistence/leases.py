"""Leases of rooms: for each room prefix, one server has the rooms."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, cast

from sqlalchemy import CursorResult, and_, delete, or_, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, sessionmaker

from relume_server.persistence.tables import RoomRow
from relume_worker.database.clock import epoch_s
from relume_worker.lease import may_run, new_owner

ROOM_LEASE_S = 3.0
"""Time after which a dead server's rooms are free: three rounds of `relume_server.collaboration.room_lease`."""

_STALE_S = 3600.0
"""Time after which a dead server's unused leases are deleted."""


class RoomLeases:
    """Leases of one server, one per room prefix. Thread-safe."""

    def __init__(self, sessions: sessionmaker[Session]) -> None:
        self._sessions, self._owner = sessions, new_owner()

    def take(self, prefix: str) -> bool:
        """Take or renew a lease. False if another live server has it."""
        row = RoomRow
        query = select(row.owner, row.heartbeat, epoch_s().label("now")).where(row.prefix == prefix)
        with self._sessions() as session:
            lease = session.execute(query).one_or_none()
        if lease is None:
            return self._add(prefix)
        is_fresh = lease.now - lease.heartbeat <= ROOM_LEASE_S
        if lease.owner != self._owner and is_fresh and may_run(lease.owner):
            return False
        unchanged = row.prefix == prefix, row.owner == lease.owner, row.heartbeat == lease.heartbeat
        statement = update(row).where(*unchanged).values(owner=self._owner, heartbeat=epoch_s())
        with self._sessions.begin() as session:  # if two servers find a dead one's lease, only one changes the row
            return cast("CursorResult[Any]", session.execute(statement)).rowcount > 0

    def _add(self, prefix: str) -> bool:
        try:
            with self._sessions.begin() as session:
                session.add(RoomRow(prefix=prefix, owner=self._owner, heartbeat=epoch_s()))
        except IntegrityError:  # another server added it at the same time
            return False
        return True

    def renew(self, prefixes: Collection[str]) -> set[str]:
        """Renew these leases and give up all others. Returns those that another server has."""
        row, is_owned = RoomRow, RoomRow.owner == self._owner
        is_dropped, is_old = and_(is_owned, row.prefix.not_in(prefixes)), row.heartbeat < epoch_s() - _STALE_S
        with self._sessions.begin() as session:
            session.execute(delete(row).where(or_(is_dropped, is_old)))
            session.execute(update(row).where(is_owned).values(heartbeat=epoch_s()))
            renewed = set(session.scalars(select(row.prefix).where(is_owned)))
        return {prefix for prefix in prefixes if prefix not in renewed and not self.take(prefix)}
