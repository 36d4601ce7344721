"""Whether the server is taking leave; sessions wait to hear of it."""

from __future__ import annotations

import asyncio

from server.errors import LeavingError

LEAVING = "the server is being stopped or exchanged; it is back in a while, and nothing is lost"


class Leave:
    """Begun once, on the event loop."""

    def __init__(self) -> None:
        self._begun = asyncio.Event()

    @property
    def is_taken(self) -> bool:
        """Whether it has begun."""
        return self._begun.is_set()

    def take(self) -> None:
        """Begin."""
        self._begun.set()

    async def taken(self) -> None:
        """Wait until it has begun."""
        await self._begun.wait()

    def check(self) -> None:
        """Raises LeavingError where it has begun: nothing that lasts is to be begun any more."""
        if self.is_taken:
            raise LeavingError(LEAVING)
