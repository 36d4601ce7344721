"""Lets go of what nobody uses: bakes that nobody looks at, their frozen caches, and memory that is free."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection
from pathlib import Path

from relume.core.memory_usage import trim_heap
from relume_server.runtime.bake_pool import TransferPool
from relume_server.runtime.executors import Threads

log = logging.getLogger(__name__)

INTERVAL_S = 10.0


class CacheEvictor:
    """Goes round every few seconds, for as long as the server runs.

    Args:
        trim_cache: drops what the caches hold of all but these stores, down to their floor.
        used_bytes: what the caches hold. release_processes: ends processes that have nothing to do.
    """

    def __init__(
        self,
        transfers: TransferPool,
        threads: Threads,
        trim_cache: Callable[[Collection[Path]], None],
        used_bytes: Callable[[], int],
        release_processes: Callable[[], None],
    ) -> None:
        self._release_processes = release_processes
        self._transfers, self._threads, self._trim_cache = transfers, threads, trim_cache
        self._used_bytes = used_bytes

    async def run(self) -> None:
        """Go round for ever."""
        while True:
            await asyncio.sleep(INTERVAL_S)
            try:
                await self.run_once()
            except Exception:  # whatever one round meets, the next must come
                log.exception("what nobody uses could not be let go")

    async def run_once(self) -> None:
        """Let go of what has not been used for a while."""
        before = self._used_bytes()
        num_closed, used_stores = self._transfers.release()
        self._trim_cache(used_stores)
        await asyncio.to_thread(self._release_processes)
        if num_closed or self._used_bytes() < before:
            await asyncio.get_running_loop().run_in_executor(self._threads.long, trim_heap)
