"""A check whose result is shared for a moment, so that calls without a login cannot keep the database busy."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable

from fastapi.concurrency import run_in_threadpool

MAX_AGE_S = 1.0


class RecentCheck:
    """Runs a check at most once at a time, and at most once in `MAX_AGE_S`. Event loop only.

    Args:
        run: runs in a thread; raises an error if something is wrong.
    """

    def __init__(self, run: Callable[[], None]) -> None:
        self._run, self._start_s = run, -math.inf
        self._result: asyncio.Task[None] | None = None

    async def check(self) -> None:
        """Raise the error of the last check, if it failed."""
        is_running = self._result is not None and not self._result.done()
        if self._result is None or (not is_running and time.monotonic() - self._start_s > MAX_AGE_S):
            self._start_s = time.monotonic()
            self._result = asyncio.create_task(run_in_threadpool(self._run))
        await asyncio.shield(self._result)  # one canceled waiter does not cancel the others
