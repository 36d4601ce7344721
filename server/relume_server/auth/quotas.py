"""How much each may have: bytes of uploads, bakes and renders, bakes that wait or run, live sessions."""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

from sqlalchemy import delete, func, select, update
from sqlalchemy.orm import Session, sessionmaker

from relume.core.errors import bytes_text
from relume_server.auth.roles import Caller
from relume_server.auth.tables import OwnedRow
from relume_server.errors import BusyError, NearlyFullError, QuotaError
from relume_server.runtime.disk_space import free_bytes
from relume_worker.database.models import BakeRow

if TYPE_CHECKING:
    from relume_server.settings import Settings

log = logging.getLogger(__name__)
OwnedKind = Literal["upload", "scene", "environment", "material", "btf-job", "btf", "image", "bake", "render"]
_ACTIVE = ("queued", "running")
MAX_STREAMS_EACH = 32
"""Streams of events that one caller may have open."""


class Quotas:
    """What belongs to whom, and whether there is room for more; may be used from any thread.

    Things are shared: who brings what is here already owns nothing of it.

    Attributes:
        settings: of the server.
        deciding: held while something is looked at and counted, lest two at once both be the last that may.
    """

    def __init__(self, sessions: sessionmaker[Session], settings: Settings) -> None:
        self._sessions, self.settings = sessions, settings
        self._lock, self._open, self._streams = threading.Lock(), Counter[str](), Counter[str]()
        self._is_full = False
        self.deciding = threading.Lock()

    @property
    def num_sessions(self) -> int:
        """Live sessions of all."""
        return self._open.total()

    @contextmanager
    def session(self, user: str) -> Iterator[None]:
        """One live session of somebody. Raises BusyError, QuotaError: enough are open."""
        max_total, max_each = self.settings.max_sessions, self.settings.max_sessions_per_user
        with self._lock:
            if self._open.total() >= max_total:
                raise BusyError(f"as many sessions are open as may be, {max_total}; close one and try again")
            if max_each is not None and self._open[user] >= max_each:
                text = f"you have as many sessions open as may be, {max_each}; close one (RELUME_MAX_SESSIONS_PER_USER)"
                raise QuotaError(text)
            self._open[user] += 1
        try:
            yield
        finally:
            with self._lock:
                self._open[user] -= 1
                self._open += Counter()  # forgets those who have none

    @contextmanager
    def stream(self, caller: Caller) -> Iterator[None]:
        """One stream of events of somebody, of whom is not known by name of an address. Raises QuotaError."""
        stream_key = f"name {caller.name}" if caller.name else f"address {caller.address}"
        with self._lock:
            if self._streams[stream_key] >= MAX_STREAMS_EACH:
                raise QuotaError(f"you follow as many bakes as may be, {MAX_STREAMS_EACH}; close a stream, or poll")
            self._streams[stream_key] += 1
        try:
            yield
        finally:
            with self._lock:
                self._streams[stream_key] -= 1
                self._streams += Counter()

    @property
    def counts_bytes(self) -> bool:
        """Whether there is a limit on them."""
        return self.settings.max_bytes_per_user is not None

    def check_room(self) -> None:
        """Raises NearlyFullError where the disk lacks the room that the ledger needs, to delete, too."""
        free = free_bytes(self.settings.data)
        is_full = free < self.settings.min_free_bytes
        with self._lock:
            was_full, self._is_full = self._is_full, is_full
        if is_full and not was_full:
            log.error("the disk of the data directory has %s left: nothing new is taken", bytes_text(free))
        elif was_full and not is_full:
            log.warning("the disk of the data directory has room again")
        if is_full:
            raise NearlyFullError(f"the disk of the data directory has {bytes_text(free)} left; free some space")

    def check_bytes(self, owner: str, added_bytes: int) -> None:
        """Raises QuotaError where somebody would have too much with so many bytes more; and as `check_room` does."""
        self.check_room()
        limit_bytes = self.settings.max_bytes_per_user
        if limit_bytes is None:
            return
        used_bytes = self.used_bytes(owner)
        if used_bytes + added_bytes > limit_bytes:
            raise _quota_exceeded(used_bytes, limit_bytes, added_bytes)

    def remaining_bytes(self, owner: str) -> int | None:
        """What somebody may still have, below zero where it is too much already; None where there is no limit."""
        limit_bytes = self.settings.max_bytes_per_user
        return None if limit_bytes is None else limit_bytes - self.used_bytes(owner)

    def put_reserved(self, owner: str, row_id: str, num_bytes: int) -> None:
        """What an upload takes while it is taken in, see `Reservation`; what a killed server left ends."""
        now = f"{int(time.time()):012d}"
        with self._sessions.begin() as session:
            session.execute(delete(OwnedRow).where(OwnedRow.kind == "upload", OwnedRow.object < now))
            session.merge(OwnedRow(kind="upload", object=row_id, owner=owner, bytes=num_bytes))

    def drop_reserved(self, row_id: str) -> None:
        """It takes nothing any more."""
        self.disown("upload", row_id)

    def check_reserved(self, owner: str, num_bytes: int) -> None:
        """Whether there is room for all that is reserved, of which somebody's newest is so many bytes. An upload is on
        the disk twice, as it came and under its own name. Raises QuotaError, NearlyFullError."""
        self.check_room()
        with self._sessions() as session:
            reserved_bytes = session.scalar(select(func.sum(OwnedRow.bytes)).where(OwnedRow.kind == "upload")) or 0
        disk_bytes = free_bytes(self.settings.data)
        if disk_bytes - 2 * reserved_bytes < self.settings.min_free_bytes:
            raise NearlyFullError(
                f"the disk of the data directory has {bytes_text(disk_bytes)} left, too little for "
                f"{bytes_text(num_bytes)} "
                f"more beside what else is sent now ({bytes_text(reserved_bytes - num_bytes)}); free some space"
            )
        limit_bytes = self.settings.max_bytes_per_user
        if limit_bytes is not None and (used_bytes := self.used_bytes(owner)) > limit_bytes:
            raise _quota_exceeded(used_bytes - num_bytes, limit_bytes, num_bytes)

    def check_bakes(self, owner: str) -> None:
        """Raises QuotaError where enough bakes of somebody wait or run."""
        max_bakes = self.settings.max_bakes_per_user
        if max_bakes is None:
            return
        query = (
            select(func.count())
            .select_from(OwnedRow)
            .join(BakeRow, BakeRow.id == OwnedRow.object)
            .where(OwnedRow.kind == "bake", OwnedRow.owner == owner, BakeRow.state.in_(_ACTIVE))
        )
        with self._sessions() as session:
            num_active = session.scalar(query) or 0
        if num_active >= max_bakes:
            raise QuotaError(
                f"{max_bakes} of your bakes wait or run, the most; wait, or cancel one (RELUME_MAX_BAKES_PER_USER)"
            )

    def used_bytes(self, owner: str) -> int:
        """What somebody's uploads had, finished bakes and renders have, and others are planned to take; of bakes that
        were stopped the share that is done, which is kept for a resume."""
        other_bytes = select(func.coalesce(func.sum(OwnedRow.bytes), 0)).where(
            OwnedRow.owner == owner, OwnedRow.kind != "bake"
        )
        bakes = (
            select(OwnedRow.bytes, BakeRow.bytes, BakeRow.state, BakeRow.progress)
            .join(BakeRow, BakeRow.id == OwnedRow.object)
            .where(OwnedRow.kind == "bake", OwnedRow.owner == owner)
        )
        with self._sessions() as session:
            total = int(session.scalar(other_bytes) or 0)
            for planned, written, state, progress in session.execute(bakes):
                total += planned if state in _ACTIVE else written if state == "ready" else int(planned * progress)
        return total

    def assign_owner(self, owner: str, kind: OwnedKind, object_id: str, num_bytes: int) -> None:
        """Something of so many bytes is somebody's, unless somebody has it."""
        with self._sessions.begin() as session:
            if session.get(OwnedRow, (kind, object_id)) is None:
                session.add(OwnedRow(kind=kind, object=object_id, owner=owner, bytes=num_bytes))

    @contextmanager
    def owner_assigned(self, owner: str, kind: OwnedKind, object_id: str, num_bytes: int) -> Iterator[None]:
        """What is queued inside is somebody's before anybody works on it; nobody's where that fails."""
        self.assign_owner(owner, kind, object_id, num_bytes)
        try:
            yield
        except BaseException:
            self.disown(kind, object_id)
            raise

    def set_bytes(self, kind: OwnedKind, object_id: str, num_bytes: int) -> None:
        """What was planned to take so many bytes is finished and takes these."""
        with self._sessions.begin() as session:
            session.execute(
                update(OwnedRow).where(OwnedRow.kind == kind, OwnedRow.object == object_id).values(bytes=num_bytes)
            )

    def convert(self, before: tuple[OwnedKind, str], after: tuple[OwnedKind, str], num_bytes: int) -> None:
        """Something has become another thing of so many bytes, whose owner is the same, unless somebody has it."""
        with self._sessions.begin() as session:
            row = session.get(OwnedRow, before)
            if row is None:
                return
            session.delete(row)
            if session.get(OwnedRow, after) is None:
                kind, object_id = after
                session.add(OwnedRow(kind=kind, object=object_id, owner=row.owner, bytes=num_bytes))

    def disown(self, kind: OwnedKind, *object_ids: str) -> None:
        """They are deleted."""
        with self._sessions.begin() as session:
            session.execute(delete(OwnedRow).where(OwnedRow.kind == kind, OwnedRow.object.in_(object_ids)))


def _quota_exceeded(used_bytes: int, limit_bytes: int, added_bytes: int) -> QuotaError:
    return QuotaError(
        f"you have {bytes_text(used_bytes)} of at most {bytes_text(limit_bytes)}, and this takes "
        f"{bytes_text(added_bytes)}; "
        "delete a scene, a bake, a material or a render of yours first (RELUME_MAX_BYTES_PER_USER)"
    )
