"""Things that several ask for at the same time, made once for all of them, in threads of their own."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

T = TypeVar("T")


class Once:
    """Makes each thing once however many wait for it; it forgets what nobody waits for. Used from the event loop only.

    Args:
        num_threads: at work at once. name: of the threads.
    """

    def __init__(self, num_threads: int, name: str) -> None:
        self._threads = ThreadPoolExecutor(num_threads, name)
        self._making: dict[Hashable, asyncio.Future[Any]] = {}

    async def make(self, key: Hashable, work: Callable[[], T]) -> T:
        """What `work` returns or raises, or the work of somebody else under the same key that is not done."""
        making: asyncio.Future[T] | None = self._making.get(key)
        if making is None:
            making = self._making[key] = asyncio.get_running_loop().run_in_executor(self._threads, work)
            making.add_done_callback(lambda done: self._forget(key, done))
        return await asyncio.shield(making)  # who goes away does not end it for others

    def _forget(self, key: Hashable, done: asyncio.Future[Any]) -> None:
        del self._making[key]
        if not done.cancelled():
            done.exception()  # perhaps nobody is left to hear of it

    def close(self) -> None:
        """Take no more work; what runs is finished."""
        self._threads.shutdown(wait=True, cancel_futures=True)
