"""Things that several ask for at the same time, made once for all of them, in threads of their own."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

T = TypeVar("T")


class SingleFlight:
    """Makes each thing once however many wait for it; it forgets what nobody waits for. Used from the event loop only.

    Args:
        num_threads: at work at once. name: of the threads.
    """

    def __init__(self, num_threads: int, name: str) -> None:
        self._threads = ThreadPoolExecutor(num_threads, name)
        self._futures: dict[Hashable, asyncio.Future[Any]] = {}

    async def run(self, key: Hashable, work: Callable[[], T]) -> T:
        """What `work` returns or raises, or the work of somebody else under the same key that is not done."""
        future: asyncio.Future[T] | None = self._futures.get(key)
        if future is None:
            future = self._futures[key] = asyncio.get_running_loop().run_in_executor(self._threads, work)
            future.add_done_callback(lambda done: self._remove(key, done))
        return await asyncio.shield(future)  # who goes away does not end it for others

    def _remove(self, key: Hashable, done: asyncio.Future[Any]) -> None:
        del self._futures[key]
        if not done.cancelled():
            done.exception()  # perhaps nobody is left to hear of it

    def close(self) -> None:
        """Take no more work; what runs is finished."""
        self._threads.shutdown(wait=True, cancel_futures=True)
