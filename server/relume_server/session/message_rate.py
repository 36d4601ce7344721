"""How fast the messages of one session are taken: nobody who sends as fast as they can is in the way of others."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable

from relume.core.errors import ProtocolError
from relume_server.auth.rate_limit import TokenBuckets
from relume_server.errors import CLOSE_POLICY

MESSAGES_PER_SECOND, MESSAGE_BURST = 200.0, 400
"""More than a hand makes that moves at each frame of a fast screen."""
MAX_BUSY_S = 10.0
"""Who sends more for so long is told to go."""
CPU_FRACTION, WORK_BURST_S = 0.15, 0.3
"""Of the event loop's time for one session's messages: on the mean, and after a rest."""
_MIN_SLEEP_S = 0.001


class Pace:
    """A bucket of messages, and one of the time that they take; used from the event loop only.

    Args:
        clock, work_clock: seconds, and those that this thread has worked. sleep: as `asyncio.sleep`.
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
        """A message has come: what is done until the next `pause` is done for it."""
        self._started_s = self._work_clock()

    async def pause(self, *, is_due: bool) -> None:
        """Before the next message: let others go on, and wait if there was too much.

        Args:
            is_due: the message acknowledged a frame: it does not count, and allows one more. So the server itself says
                how fast a program may edit that waits for frames.
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
