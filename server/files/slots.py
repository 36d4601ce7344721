"""So many things at once, in turns between those who ask."""

from __future__ import annotations

import asyncio
import itertools
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

from worker.turns import Turns, Waiting


class Slots:
    """Slots, each held by somebody for a while. Used from the event loop only.

    Args:
        num: how many there are. each: how many of them one client may hold.
        shares: turns of some clients, see `worker.turns.Turns`.
    """

    def __init__(self, num: int, each: int, shares: Mapping[str, float]) -> None:
        self._free, self._each = num, each
        self._turns, self._numbers = Turns(shares), itertools.count()
        self._held = Counter[str]()
        self._waiting: dict[Waiting, asyncio.Future[None]] = {}

    @asynccontextmanager
    async def held(self, client: str) -> AsyncIterator[None]:
        """Wait for a slot, and hold it for as long as the block runs."""
        number = next(self._numbers)
        ticket, turn = Waiting(str(number), client, False, number), asyncio.get_running_loop().create_future()
        self._waiting[ticket] = turn
        self._hand_out()
        try:
            await turn
            yield
        finally:
            if self._waiting.pop(ticket, None) is None:  # it was handed out, be it to one who does not wait any more
                self._free += 1
                self._held[client] -= 1
                self._held += Counter()  # forgets those who have none
                self._hand_out()

    def _hand_out(self) -> None:
        while self._free:
            waiting = self._turns.order(list(self._waiting))
            able = [ticket for ticket in waiting if self._held[ticket.client] < self._each]
            if not able:
                return
            self._turns.take(able[0].client)
            self._free -= 1
            self._held[able[0].client] += 1
            self._waiting.pop(able[0]).set_result(None)
