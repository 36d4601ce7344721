"""Lets go of what nobody uses: bakes that nobody looks at, their frozen caches, and memory that is free."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection
from pathlib import Path

from relume.resident import give_back
from server.library.threads import Threads
from server.library.transfers import TransferPool

log = logging.getLogger(__name__)

ROUND_S = 10.0


class Caretaker:
    """Goes round every few seconds, for as long as the server runs.

    Args:
        shrink: drops what the caches hold of all but these stores, down to their floor.
        used_bytes: what the caches hold. let_go: ends processes that have nothing to do.
    """

    def __init__(
        self,
        transfers: TransferPool,
        threads: Threads,
        shrink: Callable[[Collection[Path]], None],
        used_bytes: Callable[[], int],
        let_go: Callable[[], None],
    ) -> None:
        self._let_go = let_go
        self._transfers, self._threads, self._shrink = transfers, threads, shrink
        self._used_bytes = used_bytes

    async def run(self) -> None:
        """Go round for ever."""
        while True:
            await asyncio.sleep(ROUND_S)
            try:
                await self.go_round()
            except Exception:  # whatever one round meets, the next must come
                log.exception("what nobody uses could not be let go")

    async def go_round(self) -> None:
        """Let go of what has not been used for a while."""
        before = self._used_bytes()
        num_closed, used = self._transfers.let_go()
        self._shrink(used)
        await asyncio.to_thread(self._let_go)
        if num_closed or self._used_bytes() < before:
            await asyncio.get_running_loop().run_in_executor(self._threads.long, give_back)
