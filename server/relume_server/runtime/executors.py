"""Thread pools: one for short steps of images, one for long work (opening, precomputing)."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Any, ParamSpec, TypeVar

from relume.core.thread_pools import mark_background_thread, run_frame

P = ParamSpec("P")
T = TypeVar("T")
NUM_QUERIES = 2
NUM_LONG = 8  # more than cores: opening a view must not wait for others' precomputing


class Threads:
    """Thread pools of the app.

    Attributes:
        queries: threads for short database queries that must not wait: room leases, events.
        short_slots: number of sessions in the pool for short steps, first come, first served.
    """

    def __init__(self) -> None:
        num_short = max(2, os.cpu_count() or 1)
        self.short = ThreadPoolExecutor(num_short, "relume-frame")
        self.short_slots = asyncio.Semaphore(num_short)
        self.long = ThreadPoolExecutor(NUM_LONG, "relume-long", mark_background_thread)
        self.queries = ThreadPoolExecutor(NUM_QUERIES, "relume-news")

    def close(self) -> None:
        """Accept no more work; running work finishes."""
        self.short.shutdown(wait=True, cancel_futures=True)
        self.long.shutdown(wait=True, cancel_futures=True)
        self.queries.shutdown(wait=True, cancel_futures=True)


class SerialExecutor:
    """Runs the work of one image, and waits for it at the end, because a thread cannot be interrupted."""

    def __init__(self, threads: Threads) -> None:
        self._threads = threads
        self._running: Future[Any] | None = None

    @asynccontextmanager
    async def acquire_slot(self) -> AsyncIterator[None]:
        """Wait for a thread for short steps. Read the inputs inside, because they change while waiting."""
        async with self._threads.short_slots:
            yield

    async def run_in_slot(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a short step inside `acquire_slot`."""
        self._running = future = self._threads.short.submit(lambda: run_frame(work, *args, **kwargs))
        return await asyncio.wrap_future(future)

    async def run_short(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Wait for a slot, and run a short step."""
        async with self.acquire_slot():
            return await self.run_in_slot(work, *args, **kwargs)

    def submit_long(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> asyncio.Future[T]:
        """Start long work."""
        self._running = future = self._threads.long.submit(work, *args, **kwargs)
        return asyncio.wrap_future(future)

    async def join(self) -> None:
        """Wait until nothing runs."""
        while self._running is not None and not self._running.done():
            await asyncio.sleep(0.01)
