"""Keep a room on one server: other servers refuse it, so that a load balancer tries the next one."""

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
    """Holds the leases of this server's rooms. Event loop only.

    Args:
        rooms: rooms of this server. leases: leases in the database. drain: when the server drains, its rooms are free.
        threads: threads for leases; for short work only.
    """

    def __init__(self, rooms: Rooms, leases: RoomLeases, drain: DrainState, threads: Executor) -> None:
        self._threads = threads
        self._rooms, self._leases, self._drain = rooms, leases, drain
        self._sessions, self._has_leases = Counter[str](), False
        self._lock = asyncio.Lock()  # serializes taking with the renewal, which would give up an unknown lease
        self._outage = DatabaseError(log, "the leases of rooms cannot be read")

    @asynccontextmanager
    async def hold(self, prefix: str) -> AsyncIterator[None]:
        """Hold the lease while a session is in a room with this prefix, or is joining.

        Raises OtherServerError if another server has these rooms.
        """
        self._sessions[prefix] += 1
        try:
            if not await self._take(prefix):
                raise OtherServerError("another server has this room; connect through the load balancer, or try again")
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
            except DATABASE_ERRORS as error:  # the next renewal retries
                self._outage.report_failure(error)
                return True

    async def run(self) -> None:
        """Renew the leases until the server drains."""
        while not self._drain.is_draining:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._drain.wait(), RENEW_INTERVAL_S)
            await self.refresh()

    async def refresh(self) -> None:
        """Renew the leases, if any; members of rooms that another server took over must go there."""
        async with self._lock:
            prefixes = set() if self._drain.is_draining else {*self._sessions, *self._rooms.prefixes()}
            if not prefixes and not self._has_leases:
                return
            try:
                lost = await self._ask(self._leases.renew, prefixes)
                self._has_leases = bool(prefixes)
                self._outage.report_recovered()
            except Exception as error:  # the task must survive an unavailable database
                self._outage.report_failure(error)
                return
        for prefix in lost:
            self._rooms.lose(prefix)

    async def _ask(self, question: Callable[[Argument], T], argument: Argument) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._threads, question, argument)

    async def close(self) -> None:
        """Give up all leases."""
        with suppress(*DATABASE_ERRORS):  # otherwise the leases expire
            await self._ask(self._leases.renew, ())
