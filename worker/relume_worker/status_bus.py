"""Notify subscribers of changes of a bake, whichever process runs it."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf

from relume.core.errors import DiskFullError, NotFoundError
from relume_worker.database.failures import DATABASE_ERRORS, DatabaseError
from relume_worker.status import BakeStatus

POLL_S = 0.5
log = logging.getLogger(__name__)


class Subscription:
    """Changes of one bake, starting with its current state. Close it, or use it as a context manager.

    Attributes:
        latest: newest state that was read.
    """

    def __init__(self, bus: StatusBus, bake_id: str) -> None:
        self._bus, self._bake_id = bus, bake_id
        self.latest = bus.read(bake_id)
        self._is_first, self._has_ended = True, False

    @property
    def is_closed(self) -> bool:
        """True if no change follows: it was closed, or the bake was deleted."""
        return self._has_ended or self._bus.is_closed

    def get(self, timeout: float | None = None) -> BakeStatus | None:
        """Next change; None after `timeout` seconds, or if the subscription was closed."""
        if self._is_first:
            self._is_first = False
            return self.latest
        deadline = inf if timeout is None else time.monotonic() + timeout
        while not self.is_closed:
            num_changes = self._bus.num_changes
            if (status := self._read()) is not None and status != self.latest:
                self.latest = status
                return status
            if (left_s := deadline - time.monotonic()) <= 0:
                break
            self._bus.wait(num_changes, min(POLL_S, left_s))
        return None

    def _read(self) -> BakeStatus | None:
        try:
            status = self._bus.read(self._bake_id)
        except NotFoundError:
            self._has_ended = True
        except DATABASE_ERRORS as error:
            self._bus.database_error.report_failure(error)
        else:
            self._bus.database_error.report_recovered()
            return status
        return None

    def __iter__(self) -> Iterator[BakeStatus]:
        """Yield changes until the bake is ready, failed or canceled, or the subscription is closed."""
        while (status := self.get()) is not None:
            yield status
            if status.final:
                return

    def close(self) -> None:
        """End the subscription; its iterators end too."""
        self._has_ended = True
        self._bus.notify_change()

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class StatusBus:
    """Wakes subscriptions at once after a change by this process; they also look every half second.

    Args:
        read: returns a bake. Raises NotFoundError.
    """

    def __init__(self, read: Callable[[str], BakeStatus]) -> None:
        self.read, self.num_changes, self.is_closed = read, 0, False
        self._changed = threading.Condition()
        self.database_error = DatabaseError(log, "changes of bakes cannot be read")

    def notify_change(self) -> None:
        """Look now, because this process has changed the ledger."""
        with self._changed:
            self.num_changes += 1
            self._changed.notify_all()

    def wait(self, num_changes: int, timeout_s: float) -> None:
        """Wait until there were more than `num_changes` changes, at most `timeout_s` seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self.num_changes != num_changes, timeout_s)

    def close(self) -> None:
        """End all subscriptions."""
        self.is_closed = True
        self.notify_change()


class BlockedBake:
    """Bakes blocked by an error that the ledger cannot store, such as a full disk, with their progress then."""

    def __init__(self) -> None:
        self._blocked: dict[str, tuple[float, str]] = {}

    def report_blocked(self, status: BakeStatus, error: Exception) -> None:
        """Record that a bake could not be claimed, or could not continue."""
        if isinstance(error, DiskFullError):
            self._blocked[status.id] = status.progress, str(error)

    def report_resumed(self, bake_id: str) -> None:
        """Record that a bake continues."""
        self._blocked.pop(bake_id, None)

    def with_reason(self, status: BakeStatus) -> BakeStatus:
        """Add the reason to a blocked bake's status, unless it has continued elsewhere."""
        progress, reason = self._blocked.get(status.id, (status.progress, ""))
        if status.final or status.progress > progress:
            self.report_resumed(status.id)
        elif reason and status.problem is None:
            return replace(status, problem=f"{reason}; the bake resumes by itself")
        return status
