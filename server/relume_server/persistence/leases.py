"""Which server has the rooms of a name: a lease in the ledger, so that of several servers one has them."""

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
"""How long a room waits when its server has died: three rounds of `relume_server.collaboration.room_lease`."""

_STALE_S = 3600.0
"""What a server that died has left is deleted after so long, if nobody wants it."""


class RoomLeases:
    """The leases of one server; may be used from any thread. One is of all rooms whose names begin alike."""

    def __init__(self, sessions: sessionmaker[Session]) -> None:
        self._sessions, self._owner = sessions, new_owner()

    def take(self, prefix: str) -> bool:
        """Take or renew one. False where another server that is alive has it."""
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
        with self._sessions.begin() as session:  # of two servers that come upon a dead one's lease one changes the row
            return cast("CursorResult[Any]", session.execute(statement)).rowcount > 0

    def _add(self, prefix: str) -> bool:
        try:
            with self._sessions.begin() as session:
                session.add(RoomRow(prefix=prefix, owner=self._owner, heartbeat=epoch_s()))
        except IntegrityError:  # another server has added it in this moment
            return False
        return True

    def renew(self, prefixes: Collection[str]) -> set[str]:
        """Renew these and give up all others. Returns those of them that another server has."""
        row, is_owned = RoomRow, RoomRow.owner == self._owner
        is_dropped, is_old = and_(is_owned, row.prefix.not_in(prefixes)), row.heartbeat < epoch_s() - _STALE_S
        with self._sessions.begin() as session:
            session.execute(delete(row).where(or_(is_dropped, is_old)))
            session.execute(update(row).where(is_owned).values(heartbeat=epoch_s()))
            renewed = set(session.scalars(select(row.prefix).where(is_owned)))
        return {prefix for prefix in prefixes if prefix not in renewed and not self.take(prefix)}
