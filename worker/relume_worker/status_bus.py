"""Notify subscribers of changes of a bake, whichever process runs it."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace

from relume.core.errors import DiskFullError, NotFoundError
from relume_worker.database.failures import DATABASE_ERRORS, DatabaseError
from relume_worker.status import BakeStatus

POLL_S = 0.5
log = logging.getLogger(__name__)


class Subscription:
    """Changes of one bake, starting with its current state. Close it, or use it as a context manager.

    Attributes:
        latest: newest state. is_closed: no change follows: it was closed, or the bake was deleted.
    """

    def __init__(self, bus: StatusBus, bake_id: str, first: BakeStatus) -> None:
        self.bake_id = bake_id
        self.latest, self.is_closed = first, False
        self._bus = bus
        self._changes: queue.SimpleQueue[BakeStatus | None] = queue.SimpleQueue()
        self._changes.put(first)

    def get(self, timeout: float | None = None) -> BakeStatus | None:
        """Next change; None after `timeout` seconds, or if the subscription was closed."""
        try:
            return self._changes.get(timeout=timeout)
        except queue.Empty:
            return None

    def __iter__(self) -> Iterator[BakeStatus]:
        """Yield changes until the bake is ready, failed or canceled, or the subscription is closed."""
        while (status := self._changes.get()) is not None:
            yield status
            if status.final:
                return

    def put(self, status: BakeStatus) -> None:
        """Deliver a status if it differs from the last."""
        if status != self.latest:
            self.latest = status
            self._changes.put(status)

    def close(self) -> None:
        """End the subscription; its iterators end too."""
        self._bus.remove(self)
        self.is_closed = True
        self._changes.put(None)

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class StatusBus:
    """Polls bakes for all subscriptions: at once after a change by this process, otherwise every half second.

    Args:
        read: returns a bake. Raises NotFoundError.
    """

    def __init__(self, read: Callable[[str], BakeStatus]) -> None:
        self._read = read
        self._lock = threading.Lock()
        self._subscriptions: set[Subscription] = set()
        self._wake = threading.Event()
        self._is_closed = False
        self._thread: threading.Thread | None = None
        self._database_error = DatabaseError(log, "changes of bakes cannot be read")

    def subscribe(self, bake_id: str) -> Subscription:
        """Follow a bake. Raises NotFoundError."""
        subscription = Subscription(self, bake_id, self._read(bake_id))
        with self._lock:
            self._subscriptions.add(subscription)
            if self._thread is None:
                self._thread = threading.Thread(target=self._watch, name="relume-bake-status", daemon=True)
                self._thread.start()
        self._wake.set()
        return subscription

    def remove(self, subscription: Subscription) -> None:
        """Remove a subscription."""
        with self._lock:
            self._subscriptions.discard(subscription)

    def notify_change(self) -> None:
        """Poll now, because this process has changed the ledger."""
        self._wake.set()

    def close(self) -> None:
        """End all subscriptions and the thread."""
        self._is_closed = True
        self._wake.set()
        with self._lock:
            subscriptions, thread = list(self._subscriptions), self._thread
        for subscription in subscriptions:
            subscription.close()
        if thread is not None:
            thread.join()

    def _watch(self) -> None:
        while not self._is_closed:
            with self._lock:
                subscriptions = list(self._subscriptions)
            self._wake.wait(POLL_S if subscriptions else None)
            self._wake.clear()
            for bake_id in {subscription.bake_id for subscription in subscriptions}:
                try:
                    status = self._read(bake_id)
                except NotFoundError:
                    for subscription in [s for s in subscriptions if s.bake_id == bake_id]:
                        subscription.close()
                    continue
                except DATABASE_ERRORS as error:
                    self._database_error.report_failure(error)
                    continue
                self._database_error.report_recovered()
                for subscription in subscriptions:
                    if subscription.bake_id == bake_id:
                        subscription.put(status)


class BlockedBake:
    """Bakes blocked by an error that the ledger cannot store, such as a full disk, with their progress then."""

    def __init__(self) -> None:
        self._blocked: dict[str, tuple[float, str]] = {}

    def __bool__(self) -> bool:
        """True if any bake is blocked."""
        return bool(self._blocked)

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
