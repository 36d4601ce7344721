"""How fast the messages of one session are taken: nobody who sends as fast as they can is in the way of others."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable

from relume.errors import ProtocolError
from server.access.buckets import Buckets
from server.errors import CLOSE_POLICY

PER_SECOND, AT_ONCE = 200.0, 400
"""More than a hand makes that moves at each frame of a fast screen."""
PATIENCE_S = 10.0
"""Who sends more for so long is told to go."""
SHARE, WORK_AT_ONCE_S = 0.15, 0.3
"""Of the event loop's time for one session's messages: on the mean, and after a rest."""
_LEAST_S = 0.001


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
        self._bucket = Buckets(PER_SECOND, AT_ONCE, clock)
        self._work_s, self._begun_s = WORK_AT_ONCE_S, 0.0
        self._calm_s = self._paused_s = clock()

    def begin(self) -> None:
        """A message has come: what is done until the next `pause` is done for it."""
        self._begun_s = self._work_clock()

    async def pause(self, *, is_due: bool) -> None:
        """Before the next message: let others go on, and wait if there was too much.

        Args:
            is_due: the message acknowledged a frame: it does not count, and allows one more. So the server itself says
                how fast a program may edit that waits for frames.
        Raises:
            ProtocolError: there were too many for too long; carries the close code.
        """
        now_s = self._clock()
        if self._bucket.level("") > AT_ONCE / 2:
            self._calm_s = now_s
        elif now_s - self._calm_s > PATIENCE_S:
            text = f"too many messages: more than {PER_SECOND:g} a second for {PATIENCE_S:g} s; send fewer"
            raise ProtocolError(text, CLOSE_POLICY)
        rested_s, self._paused_s = now_s - self._paused_s, now_s
        spent_s = self._work_clock() - self._begun_s
        self._work_s = min(WORK_AT_ONCE_S, self._work_s + SHARE * rested_s) - spent_s
        await self._sleep(max(0.0, -self._work_s / SHARE))
        if is_due:
            self._bucket.give_back("")
        while not is_due and (wait_s := self._bucket.take("")) > 0.0:
            await self._sleep(max(wait_s, _LEAST_S))
