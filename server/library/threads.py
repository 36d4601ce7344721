"""Where heavy work runs: quick steps of pictures in one pool, long ones (opening, freezing) in another."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

from relume.parallel import do_long_work

P = ParamSpec("P")
T = TypeVar("T")
NUM_LONG = 8  # more than cores: a view that is opened must not wait until others have frozen theirs


class Threads:
    """The two pools of an app."""

    def __init__(self) -> None:
        num_cores = os.cpu_count() or 1
        self.quick = ThreadPoolExecutor(max(2, num_cores), "relume-frame")
        self.long = ThreadPoolExecutor(NUM_LONG, "relume-long", do_long_work)

    def close(self) -> None:
        """Take no more work; what runs is finished."""
        self.quick.shutdown(wait=True, cancel_futures=True)
        self.long.shutdown(wait=True, cancel_futures=True)


class OneAtATime:
    """Runs work for one picture, and at the end waits for what still runs: a thread cannot be interrupted."""

    def __init__(self, threads: Threads) -> None:
        self._threads = threads
        self._running: Future[Any] | None = None

    async def quick(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a short step."""
        self._running = future = self._threads.quick.submit(work, *args, **kwargs)
        return await asyncio.wrap_future(future)

    def long(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> asyncio.Future[T]:
        """Start something that takes its time."""
        self._running = future = self._threads.long.submit(work, *args, **kwargs)
        return asyncio.wrap_future(future)

    async def join(self) -> None:
        """Wait until nothing runs."""
        while self._running is not None and not self._running.done():
            await asyncio.sleep(0.01)
