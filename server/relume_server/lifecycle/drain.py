"""Drain state of the server, which sessions wait for."""

from __future__ import annotations

import asyncio

from relume_server.errors import DrainingError

DRAIN_MESSAGE = "the server is restarting; it will be back soon, and nothing is lost"


class DrainState:
    """Started once, on the event loop."""

    def __init__(self) -> None:
        self._started = asyncio.Event()

    @property
    def is_draining(self) -> bool:
        """True after `start`."""
        return self._started.is_set()

    def start(self) -> None:
        """Start draining."""
        self._started.set()

    async def wait(self) -> None:
        """Wait until draining starts."""
        await self._started.wait()

    def check(self) -> None:
        """Raise DrainingError if the server is draining: no sessions or streams may start."""
        if self.is_draining:
            raise DrainingError(DRAIN_MESSAGE)
