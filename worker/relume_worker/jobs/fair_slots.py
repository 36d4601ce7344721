"""Slots for bulk steps, given to clients in turn."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from relume.core.errors import CancelledError
from relume_worker.jobs.fair_share import FairShare, Waiting
from relume_worker.jobs.step import IsNeeded, Step

_POLL_S = 0.1


class FairSlots:
    """Limits the steps that run at once, and chooses the next by clients' shares.

    Args:
        num_slots: current limit. weights: of clients, see `FairShare`.
    """

    def __init__(self, num_slots: Callable[[], int], weights: Mapping[str, float]) -> None:
        self._num_slots, self._fair_share = num_slots, FairShare(weights)
        self._changed = threading.Condition()
        self._tickets = itertools.count()
        self._waiting: list[Waiting] = []
        self._num_running = 0

    @contextmanager
    def take(self, step: Step, is_needed: IsNeeded) -> Iterator[None]:
        """Wait for a slot, and hold it in the block. Raises CancelledError if the step is no longer needed."""
        ticket = next(self._tickets)
        waiting = Waiting(str(ticket), step.client, step.is_first, ticket, priority=step.priority)
        num_slots = self._num_slots()  # asked outside the lock: it may ask the cluster
        with self._changed:
            self._waiting.append(waiting)
            try:
                while self._num_running >= num_slots or self._fair_share.sort(self._waiting)[0] is not waiting:
                    if not is_needed():
                        raise CancelledError(f"the {step.kind} was stopped before it started")
                    self._changed.wait(_POLL_S)
                self._fair_share.pick_next(step.client)
                self._num_running += 1
            finally:
                self._waiting.remove(waiting)
                self._changed.notify_all()
        try:
            yield
        finally:
            with self._changed:
                self._num_running -= 1
                self._changed.notify_all()
