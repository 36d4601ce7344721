"""Message rate limit of a session, which keeps the event loop free for others."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable

from relume.core.errors import ProtocolError
from relume_server.auth.rate_limit import TokenBuckets
from relume_server.errors import CLOSE_POLICY

MESSAGES_PER_SECOND, MESSAGE_BURST = 200.0, 400
"""More than one message per frame of a fast display while dragging."""
MAX_BUSY_S = 10.0
"""Time above the limit after which a session is closed."""
CPU_FRACTION, WORK_BURST_S = 0.15, 0.3
"""Fraction of the event loop's time for one session's messages: on average, and in a burst."""
_MIN_SLEEP_S = 0.001


class MessageRateLimit:
    """Token buckets for messages, and for the time to process them. Event loop only.

    Args:
        clock, work_clock: seconds, wall and CPU time of this thread. sleep: as `asyncio.sleep`.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.perf_counter,
        work_clock: Callable[[], float] = time.thread_time,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        self._clock, self._work_clock, self._sleep = clock, work_clock, sleep
        self._bucket = TokenBuckets(MESSAGES_PER_SECOND, MESSAGE_BURST, clock)
        self._work_s, self._started_s = WORK_BURST_S, 0.0
        self._last_calm_s = self._paused_s = clock()

    def start_message(self) -> None:
        """Start measuring the processing of a message, until the next `pause`."""
        self._started_s = self._work_clock()

    async def pause(self, *, is_due: bool) -> None:
        """Let others run before the next message, and wait if there were too many.

        Args:
            is_due: the message acknowledged a frame: it is free, and allows one more. So a program that waits for
                frames edits at the server's own rate.
        Raises:
            ProtocolError: there were too many for too long; carries the close code.
        """
        now_s = self._clock()
        if self._bucket.level("") > MESSAGE_BURST / 2:
            self._last_calm_s = now_s
        elif now_s - self._last_calm_s > MAX_BUSY_S:
            text = f"too many messages: more than {MESSAGES_PER_SECOND:g} a second for {MAX_BUSY_S:g} s; send fewer"
            raise ProtocolError(text, CLOSE_POLICY)
        rested_s, self._paused_s = now_s - self._paused_s, now_s
        spent_s = self._work_clock() - self._started_s
        self._work_s = min(WORK_BURST_S, self._work_s + CPU_FRACTION * rested_s) - spent_s
        await self._sleep(max(0.0, -self._work_s / CPU_FRACTION))
        if is_due:
            self._bucket.refund("")
        while not is_due and (wait_s := self._bucket.take("")) > 0.0:
            await self._sleep(max(wait_s, _MIN_SLEEP_S))
