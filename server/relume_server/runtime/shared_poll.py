"""One question an interval for all who wait for answers: sessions share a statement instead of sending one each."""

from __future__ import annotations

import asyncio
import random
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Generic, TypeVar

Key = TypeVar("Key")
Answer = TypeVar("Answer")
JITTER = 0.2
"""Rounds begin up to this part of the interval early, so that servers that started together do not ask together."""


class SharedPoll(Generic[Key, Answer]):
    """Asks for the keys of all followers at once, in rounds, while anybody waits. Event loop only.

    Args:
        ask: returns the answers of some keys; must not raise. interval_s: longest time between two rounds.
    """

    def __init__(
        self, ask: Callable[[Collection[Key]], Awaitable[Mapping[Key, Answer]]], interval_s: Callable[[], float]
    ) -> None:
        self._ask, self._interval_s = ask, interval_s
        self._keys = Counter[Key]()
        self._waiting: asyncio.Task[Mapping[Key, Answer]] | None = None
        self._begun_s = float("-inf")

    @contextmanager
    def following(self, key: Key) -> Iterator[None]:
        """Ask for a key in all rounds during the block."""
        self._keys[key] += 1
        try:
            yield
        finally:
            self._keys[key] -= 1
            if not self._keys[key]:
                del self._keys[key]

    async def next(self, key: Key) -> Answer | None:
        """Wait for the next round; its answer for a followed key, if it has one."""
        if self._waiting is None:
            self._waiting = asyncio.create_task(self._run_round())
        return (await asyncio.shield(self._waiting)).get(key)  # the end of one follower does not end the round

    async def _run_round(self) -> Mapping[Key, Answer]:
        wait_s = self._begun_s + self._interval_s() * random.uniform(1 - JITTER, 1) - time.monotonic()
        await asyncio.sleep(max(0.0, wait_s))
        self._waiting, self._begun_s = None, time.monotonic()  # who comes now waits for the next round
        return await self._ask(list(self._keys))
