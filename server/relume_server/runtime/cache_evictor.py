"""Evict unused data: open bakes, their precomputed results, and free memory of the allocator."""

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
    """Runs every few seconds while the server runs.

    Args:
        transfers: open bakes. threads: threads for the work.
        trim_cache: evicts the results of all other stores, down to the floor.
        used_bytes: size of the caches.
    """

    def __init__(
        self,
        transfers: TransferPool,
        threads: Threads,
        trim_cache: Callable[[Collection[Path]], None],
        used_bytes: Callable[[], int],
    ) -> None:
        self._transfers, self._threads, self._trim_cache = transfers, threads, trim_cache
        self._used_bytes = used_bytes

    async def run(self) -> None:
        """Run forever."""
        while True:
            await asyncio.sleep(INTERVAL_S)
            try:
                await self.run_once()
            except Exception:  # one failed round must not end the next ones
                log.exception("unused data could not be evicted")

    async def run_once(self) -> None:
        """Evict data that has been unused for a while."""
        before = self._used_bytes()
        num_closed, used_stores = self._transfers.release()
        self._trim_cache(used_stores)
        if num_closed or self._used_bytes() < before:
            await asyncio.get_running_loop().run_in_executor(self._threads.long, trim_heap)
