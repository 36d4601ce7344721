"""Merge identical concurrent requests: the work runs once, in threads of its own."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

T = TypeVar("T")


class SingleFlight:
    """Runs each work once for all waiters; nothing is cached. Event loop only.

    Args:
        num_threads: maximum number of threads. name: name of the threads.
    """

    def __init__(self, num_threads: int, name: str) -> None:
        self._threads = ThreadPoolExecutor(num_threads, name)
        self._futures: dict[Hashable, asyncio.Future[Any]] = {}

    async def run(self, key: Hashable, work: Callable[[], T]) -> T:
        """Return or raise the result of `work`, or of the running work with the same key."""
        future: asyncio.Future[T] | None = self._futures.get(key)
        if future is None:
            future = self._futures[key] = asyncio.get_running_loop().run_in_executor(self._threads, work)
            future.add_done_callback(lambda done: self._remove(key, done))
        return await asyncio.shield(future)  # one canceled waiter does not cancel the others

    def _remove(self, key: Hashable, done: asyncio.Future[Any]) -> None:
        del self._futures[key]
        if not done.cancelled():
            done.exception()  # perhaps nobody waits any more

    def close(self) -> None:
        """Accept no more work; running work finishes."""
        self._threads.shutdown(wait=True, cancel_futures=True)
