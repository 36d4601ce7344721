"""Quotas per user: bytes of uploads, bakes, renders and comparisons, queued and running bakes, live sessions."""

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
from relume_server.errors import NearlyFullError
from relume_server.runtime.disk_space import free_bytes
from relume_worker.database.models import JobRow
from relume_worker.job_state import ACTIVE_STATES
from relume_worker.jobs.job import BusyError, QuotaError

if TYPE_CHECKING:
    from relume_server.settings import Settings

log = logging.getLogger(__name__)
OwnedKind = Literal[
    "upload",
    "scene",
    "environment",
    "material",
    "btf-job",
    "btf",
    "image",
    "ies",
    "imported",
    "lut",
    "bake",
    "render",
    "comparison",
]
MAX_STREAMS_EACH = 32
"""Maximum number of event streams per caller."""


class Quotas:
    """Ownership and quotas. Thread-safe.

    Identical content is stored once, and belongs to the first user only.

    Attributes:
        settings: settings of the server.
        deciding: lock for checking and counting in one step, so that concurrent calls cannot both pass a limit.
    """

    def __init__(self, sessions: sessionmaker[Session], settings: Settings) -> None:
        self._sessions, self.settings = sessions, settings
        self._lock, self._open, self._streams = threading.Lock(), Counter[str](), Counter[str]()
        self._is_full = False
        self.deciding = threading.Lock()

    @property
    def num_sessions(self) -> int:
        """Number of live sessions."""
        return self._open.total()

    @contextmanager
    def session(self, user: str) -> Iterator[None]:
        """Count a live session of a user. Raises BusyError, QuotaError: limit reached."""
        max_total, max_each = self.settings.max_sessions, self.settings.max_sessions_per_user
        with self._lock:
            if self._open.total() >= max_total:
                raise BusyError(f"the limit of {max_total} sessions is reached; close one and try again")
            if max_each is not None and self._open[user] >= max_each:
                text = f"you have reached the limit of {max_each} sessions; close one (RELUME_MAX_SESSIONS_PER_USER)"
                raise QuotaError(text)
            self._open[user] += 1
        try:
            yield
        finally:
            with self._lock:
                self._open[user] -= 1
                self._open += Counter()  # drop zero counts

    @contextmanager
    def stream(self, caller: Caller) -> Iterator[None]:
        """Count an event stream of a user, or of an address without login. Raises QuotaError."""
        stream_key = f"name {caller.name}" if caller.name else f"address {caller.address}"
        with self._lock:
            if self._streams[stream_key] >= MAX_STREAMS_EACH:
                raise QuotaError(f"you have reached the limit of {MAX_STREAMS_EACH} event streams; close one, or poll")
            self._streams[stream_key] += 1
        try:
            yield
        finally:
            with self._lock:
                self._streams[stream_key] -= 1
                self._streams += Counter()

    @property
    def counts_bytes(self) -> bool:
        """True if bytes are limited."""
        return self.settings.max_bytes_per_user is not None

    def check_room(self, added_bytes: int = 0) -> None:
        """Raise NearlyFullError if the disk lacks the space that the database needs, also for deleting, now or after
        so many more bytes.
        """
        free = free_bytes(self.settings.data)
        is_full = free < self.settings.min_free_bytes
        with self._lock:
            was_full, self._is_full = self._is_full, is_full
        if is_full and not was_full:
            log.error("the disk of the data directory has %s left: new work is refused", bytes_text(free))
        elif was_full and not is_full:
            log.warning("the disk of the data directory has enough space again")
        if is_full:
            raise NearlyFullError(f"the disk of the data directory has {bytes_text(free)} left; free some space")
        if free - added_bytes < self.settings.min_free_bytes:
            raise NearlyFullError(
                f"the disk of the data directory has {bytes_text(free)} left, too little for up to "
                f"{bytes_text(added_bytes)} more; free some space, or ask for less"
            )

    def check_bytes(self, owner: str, added_bytes: int) -> None:
        """Raise QuotaError if so many more bytes exceed a user's quota; and as `check_room`."""
        self.check_room(added_bytes)
        limit_bytes = self.settings.max_bytes_per_user
        if limit_bytes is None:
            return
        used_bytes = self.used_bytes(owner)
        if used_bytes + added_bytes > limit_bytes:
            raise _quota_exceeded(used_bytes, limit_bytes, added_bytes)

    def remaining_bytes(self, owner: str) -> int | None:
        """Bytes left in a user's quota, negative if exceeded; None if there is no limit."""
        limit_bytes = self.settings.max_bytes_per_user
        return None if limit_bytes is None else limit_bytes - self.used_bytes(owner)

    def put_reserved(self, owner: str, row_id: str, num_bytes: int) -> None:
        """Store the bytes that an upload reserves, see `Reservation`; those of a killed server expire."""
        now = f"{int(time.time()):012d}"
        with self._sessions.begin() as session:
            session.execute(delete(OwnedRow).where(OwnedRow.kind == "upload", OwnedRow.object < now))
            session.merge(OwnedRow(kind="upload", object=row_id, owner=owner, bytes=num_bytes))

    def drop_reserved(self, row_id: str) -> None:
        """Delete a reservation."""
        self.disown("upload", row_id)

    def check_reserved(self, owner: str, num_bytes: int) -> None:
        """Check that all reservations fit, of which the user's newest has so many bytes. An upload is on the disk
        twice: as received, and as stored. Raises QuotaError, NearlyFullError.
        """
        self.check_room()
        with self._sessions() as session:
            reserved_bytes = session.scalar(select(func.sum(OwnedRow.bytes)).where(OwnedRow.kind == "upload")) or 0
        disk_bytes = free_bytes(self.settings.data)
        if disk_bytes - 2 * reserved_bytes < self.settings.min_free_bytes:
            raise NearlyFullError(
                f"the disk of the data directory has {bytes_text(disk_bytes)} left, too little for "
                f"{bytes_text(num_bytes)} "
                f"more besides other uploads ({bytes_text(reserved_bytes - num_bytes)}); free some space"
            )
        limit_bytes = self.settings.max_bytes_per_user
        if limit_bytes is not None and (used_bytes := self.used_bytes(owner)) > limit_bytes:
            raise _quota_exceeded(used_bytes - num_bytes, limit_bytes, num_bytes)

    def check_bakes(self, owner: str) -> None:
        """Raise QuotaError if a user has the maximum number of queued and running bakes."""
        max_bakes = self.settings.max_bakes_per_user
        if max_bakes is None:
            return
        query = (
            select(func.count())
            .select_from(OwnedRow)
            .join(JobRow, JobRow.id == OwnedRow.object)
            .where(OwnedRow.kind == "bake", OwnedRow.owner == owner, JobRow.state.in_(ACTIVE_STATES))
        )
        with self._sessions() as session:
            num_active = session.scalar(query) or 0
        if num_active >= max_bakes:
            raise QuotaError(
                f"you have reached the limit of {max_bakes} queued or running bakes; wait, or cancel one "
                "(RELUME_MAX_BAKES_PER_USER)"
            )

    def used_bytes(self, owner: str) -> int:
        """Bytes of a user: uploads, finished bakes and other jobs, planned bytes of others; of a stopped bake the
        finished fraction, which is kept for a resume.
        """
        other_bytes = select(func.coalesce(func.sum(OwnedRow.bytes), 0)).where(
            OwnedRow.owner == owner, OwnedRow.kind != "bake"
        )
        bakes = (
            select(OwnedRow.bytes, JobRow.bytes, JobRow.state, JobRow.progress)
            .join(JobRow, JobRow.id == OwnedRow.object)
            .where(OwnedRow.kind == "bake", OwnedRow.owner == owner)
        )
        with self._sessions() as session:
            total = int(session.scalar(other_bytes) or 0)
            for planned, written, state, progress in session.execute(bakes):
                kept = (written or 0) if state == "ready" else int(planned * (progress or 0.0))
                total += planned if state in ACTIVE_STATES else kept
        return total

    def assign_owner(self, owner: str, kind: OwnedKind, object_id: str, num_bytes: int) -> None:
        """Make a user the owner of an object of so many bytes, unless it has one."""
        with self._sessions.begin() as session:
            if session.get(OwnedRow, (kind, object_id)) is None:
                session.add(OwnedRow(kind=kind, object=object_id, owner=owner, bytes=num_bytes))

    @contextmanager
    def owner_assigned(self, owner: str, kind: OwnedKind, object_id: str, num_bytes: int) -> Iterator[None]:
        """Assign the owner of an object before it is queued inside; undone if queuing fails."""
        self.assign_owner(owner, kind, object_id, num_bytes)
        try:
            yield
        except BaseException:
            self.disown(kind, object_id)
            raise

    @contextmanager
    def planned(self, owner: str, kind: OwnedKind, object_id: str, max_bytes: int) -> Iterator[None]:
        """Check that an object of at most so many bytes fits, and assign its owner as `owner_assigned`.

        Raises QuotaError, NearlyFullError.
        """
        with self.deciding:
            self.check_bytes(owner, max_bytes)
            with self.owner_assigned(owner, kind, object_id, max_bytes):
                yield

    def set_bytes(self, kind: OwnedKind, object_id: str, num_bytes: int) -> None:
        """Replace the planned bytes of an object by its final ones."""
        with self._sessions.begin() as session:
            session.execute(
                update(OwnedRow).where(OwnedRow.kind == kind, OwnedRow.object == object_id).values(bytes=num_bytes)
            )

    def convert(self, before: tuple[OwnedKind, str], after: tuple[OwnedKind, str], num_bytes: int) -> None:
        """Convert an object into another of so many bytes with the same owner, unless that has one."""
        with self._sessions.begin() as session:
            row = session.get(OwnedRow, before)
            if row is None:
                return
            session.delete(row)
            if session.get(OwnedRow, after) is None:
                kind, object_id = after
                session.add(OwnedRow(kind=kind, object=object_id, owner=row.owner, bytes=num_bytes))

    def disown(self, kind: OwnedKind, *object_ids: str) -> None:
        """Delete the ownership of deleted objects."""
        with self._sessions.begin() as session:
            session.execute(delete(OwnedRow).where(OwnedRow.kind == kind, OwnedRow.object.in_(object_ids)))


def _quota_exceeded(used_bytes: int, limit_bytes: int, added_bytes: int) -> QuotaError:
    return QuotaError(
        f"you have {bytes_text(used_bytes)} of at most {bytes_text(limit_bytes)}, and this takes "
        f"{bytes_text(added_bytes)}; "
        "delete a scene, bake, material, comparison or render of yours first (RELUME_MAX_BYTES_PER_USER)"
    )
