"""Whether the server is taking leave; sessions wait to hear of it."""

from __future__ import annotations

import asyncio

from relume_server.errors import DrainingError

DRAIN_MESSAGE = "the server is being stopped or exchanged; it is back in a while, and nothing is lost"


class DrainState:
    """Begun once, on the event loop."""

    def __init__(self) -> None:
        self._started = asyncio.Event()

    @property
    def is_draining(self) -> bool:
        """Whether it has begun."""
        return self._started.is_set()

    def start(self) -> None:
        """Begin."""
        self._started.set()

    async def wait(self) -> None:
        """Wait until it has begun."""
        await self._started.wait()

    def check(self) -> None:
        """Raises LeavingError where it has begun: nothing that lasts is to be begun any more."""
        if self.is_draining:
            raise DrainingError(DRAIN_MESSAGE)
