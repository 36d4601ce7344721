"""A limited number of slots, assigned fairly between clients."""

from __future__ import annotations

import asyncio
import itertools
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

from relume_worker.jobs.fair_share import FairShare, Waiting


class Slots:
    """Slots for concurrent work. Event loop only.

    Args:
        num_slots: total number of slots. max_per_client: maximum number of slots that one client holds.
        weights: weights of clients, see `relume_worker.jobs.fair_share.FairShare`.
    """

    def __init__(self, num_slots: int, max_per_client: int, weights: Mapping[str, float]) -> None:
        self._free, self._each = num_slots, max_per_client
        self._fair_share, self._numbers = FairShare(weights), itertools.count()
        self._num_held = Counter[str]()
        self._waiting: dict[Waiting, asyncio.Future[None]] = {}

    @asynccontextmanager
    async def acquire(self, client: str) -> AsyncIterator[None]:
        """Wait for a slot, and hold it inside the block."""
        number = next(self._numbers)
        ticket, granted = Waiting(str(number), client, False, number), asyncio.get_running_loop().create_future()
        self._waiting[ticket] = granted
        self._grant_slots()
        try:
            await granted
            yield
        finally:
            if (
                self._waiting.pop(ticket, None) is None
            ):  # the slot was granted, perhaps after its client had stopped waiting
                self._free += 1
                self._num_held[client] -= 1
                self._num_held += Counter()  # drop zero counts
                self._grant_slots()

    def _grant_slots(self) -> None:
        while self._free:
            waiting = self._fair_share.sort(list(self._waiting))
            eligible = [ticket for ticket in waiting if self._num_held[ticket.client] < self._each]
            if not eligible:
                return
            self._fair_share.pick_next(eligible[0].client)
            self._free -= 1
            self._num_held[eligible[0].client] += 1
            self._waiting.pop(eligible[0]).set_result(None)
