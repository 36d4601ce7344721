"""Tells whoever asked when a bake changes, whichever process runs it."""

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
    """Changes of one bake, the state at the time of asking first. Close it, or use it as a context manager.

    Attributes:
        latest: the newest state. is_closed: no change follows: it was closed, as where the bake was deleted.
    """

    def __init__(self, bus: StatusBus, bake_id: str, first: BakeStatus) -> None:
        self.bake_id = bake_id
        self.latest, self.is_closed = first, False
        self._bus = bus
        self._changes: queue.SimpleQueue[BakeStatus | None] = queue.SimpleQueue()
        self._changes.put(first)

    def get(self, timeout: float | None = None) -> BakeStatus | None:
        """The next change; None where none came within `timeout` seconds, or the subscription was closed."""
        try:
            return self._changes.get(timeout=timeout)
        except queue.Empty:
            return None

    def __iter__(self) -> Iterator[BakeStatus]:
        """Changes until the bake is ready, failed or cancelled, or the subscription is closed."""
        while (status := self._changes.get()) is not None:
            yield status
            if status.final:
                return

    def put(self, status: BakeStatus) -> None:
        """Hand over a status where it differs from the last."""
        if status != self.latest:
            self.latest = status
            self._changes.put(status)

    def close(self) -> None:
        """End the subscription; an iterator over it ends too."""
        self._bus.remove(self)
        self.is_closed = True
        self._changes.put(None)

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class StatusBus:
    """Looks at bakes for all subscriptions: at once when this process changed any, else every half second.

    Args:
        read: a bake as it is now. Raises NotFoundError.
    """

    def __init__(self, read: Callable[[str], BakeStatus]) -> None:
        self._read = read
        self._lock = threading.Lock()
        self._subscriptions: set[Subscription] = set()
        self._wake = threading.Event()
        self._is_closed = False
        self._thread: threading.Thread | None = None
        self._database_error = DatabaseError(log, "changes of bakes cannot be told")

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
        """Stop telling a subscription."""
        with self._lock:
            self._subscriptions.discard(subscription)

    def notify_change(self) -> None:
        """The ledger was changed by this process."""
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
    """What hinders bakes that the ledger cannot be told of, as on a full disk, and how far each was then."""

    def __init__(self) -> None:
        self._blocked: dict[str, tuple[float, str]] = {}

    def __bool__(self) -> bool:
        """Whether anything does."""
        return bool(self._blocked)

    def report_blocked(self, status: BakeStatus, error: Exception) -> None:
        """A bake could not be claimed, or could not go on."""
        if isinstance(error, DiskFullError):
            self._blocked[status.id] = status.progress, str(error)

    def report_resumed(self, bake_id: str) -> None:
        """It goes on."""
        self._blocked.pop(bake_id, None)

    def with_reason(self, status: BakeStatus) -> BakeStatus:
        """A status with what hinders it, unless it has gone on elsewhere."""
        progress, reason = self._blocked.get(status.id, (status.progress, ""))
        if status.final or status.progress > progress:
            self.report_resumed(status.id)
        elif reason and status.problem is None:
            return replace(status, problem=f"{reason}; the bake goes on by itself")
        return status
