"""Keeps a room on one server: whoever comes to another is refused there, for a balancer to try the next one."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Executor
from contextlib import asynccontextmanager, suppress
from typing import TypeVar

from relume_server.collaboration.rooms import Rooms
from relume_server.errors import OtherServerError
from relume_server.lifecycle.drain import DrainState
from relume_server.persistence.leases import RoomLeases
from relume_worker.database.failures import DATABASE_ERRORS, DatabaseError

log = logging.getLogger(__name__)

RENEW_INTERVAL_S = 1.0
Argument = TypeVar("Argument")
T = TypeVar("T")


class RoomLease:
    """Holds the leases of this server's rooms. Used from the event loop only.

    Args:
        drain: when the server takes leave its rooms are anybody's.
        threads: that leases are taken in; nothing slow may run there.
    """

    def __init__(self, rooms: Rooms, leases: RoomLeases, drain: DrainState, threads: Executor) -> None:
        self._threads = threads
        self._rooms, self._leases, self._drain = rooms, leases, drain
        self._sessions, self._has_leases = Counter[str](), False
        self._lock = asyncio.Lock()  # what is taken is not given up by a round that has not heard of it
        self._outage = DatabaseError(log, "which server has a room cannot be told")

    @asynccontextmanager
    async def hold(self, prefix: str) -> AsyncIterator[None]:
        """For as long as a session is in a room whose name begins so, or tries to be.

        Raises ElsewhereError where another server has these rooms.
        """
        self._sessions[prefix] += 1
        try:
            if not await self._take(prefix):
                raise OtherServerError("another server has this room; come to it by way of the balancer, or try again")
            yield
        finally:
            self._sessions[prefix] -= 1
            if not self._sessions[prefix]:
                del self._sessions[prefix]

    async def _take(self, prefix: str) -> bool:
        async with self._lock:
            self._has_leases = True
            try:
                return await self._ask(self._leases.take, prefix)
            except DATABASE_ERRORS as error:  # the next round tries again
                self._outage.report_failure(error)
                return True

    async def run(self) -> None:
        """Keep what there is until the server takes leave."""
        while not self._drain.is_draining:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._drain.wait(), RENEW_INTERVAL_S)
            await self.refresh()

    async def refresh(self) -> None:
        """Keep what there is, if anything; who is in a room that another server has meanwhile has to go there."""
        async with self._lock:
            prefixes = set() if self._drain.is_draining else {*self._sessions, *self._rooms.prefixes()}
            if not prefixes and not self._has_leases:
                return
            try:
                lost = await self._ask(self._leases.renew, prefixes)
                self._has_leases = bool(prefixes)
                self._outage.report_recovered()
            except Exception as error:  # the database may be away for a while; the next look must come
                self._outage.report_failure(error)
                return
        for prefix in lost:
            self._rooms.lose(prefix)

    async def _ask(self, question: Callable[[Argument], T], argument: Argument) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._threads, question, argument)

    async def close(self) -> None:
        """Give up all."""
        with suppress(*DATABASE_ERRORS):  # then the leases run out
            await self._ask(self._leases.renew, ())
