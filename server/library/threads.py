"""Where heavy work runs: quick steps of pictures in one pool, long ones (opening, freezing) in another."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Any, ParamSpec, TypeVar

from relume.parallel import do_long_work, make_frame

P = ParamSpec("P")
T = TypeVar("T")
NUM_NEWS = 2
NUM_LONG = 8  # more than cores: a view that is opened must not wait until others have frozen theirs


class Threads:
    """The pools of an app.

    Attributes:
        news: for short questions to the database that must not wait for anything else: whose a room is, what is new.
        turns: of sessions at the pool for quick steps, in the order in which they asked.
    """

    def __init__(self) -> None:
        num_quick = max(2, os.cpu_count() or 1)
        self.quick = ThreadPoolExecutor(num_quick, "relume-frame")
        self.turns = asyncio.Semaphore(num_quick)
        self.long = ThreadPoolExecutor(NUM_LONG, "relume-long", do_long_work)
        self.news = ThreadPoolExecutor(NUM_NEWS, "relume-news")

    def close(self) -> None:
        """Take no more work; what runs is finished."""
        self.quick.shutdown(wait=True, cancel_futures=True)
        self.long.shutdown(wait=True, cancel_futures=True)
        self.news.shutdown(wait=True, cancel_futures=True)


class OneAtATime:
    """Runs work for one picture, and at the end waits for what still runs: a thread cannot be interrupted."""

    def __init__(self, threads: Threads) -> None:
        self._threads = threads
        self._running: Future[Any] | None = None

    @asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Wait for a thread for short steps. What is asked of it is best said inside: until then it grows old."""
        async with self._threads.turns:
            yield

    async def in_turn(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a short step inside `turn`."""
        self._running = future = self._threads.quick.submit(lambda: make_frame(work, *args, **kwargs))
        return await asyncio.wrap_future(future)

    async def quick(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Wait for a turn, and run a short step."""
        async with self.turn():
            return await self.in_turn(work, *args, **kwargs)

    def long(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> asyncio.Future[T]:
        """Start something that takes its time."""
        self._running = future = self._threads.long.submit(work, *args, **kwargs)
        return asyncio.wrap_future(future)

    async def join(self) -> None:
        """Wait until nothing runs."""
        while self._running is not None and not self._running.done():
            await asyncio.sleep(0.01)
