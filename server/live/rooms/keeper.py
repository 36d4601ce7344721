"""Keeps a room on one server: whoever comes to another is refused there, for a balancer to try the next one."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Executor
from contextlib import asynccontextmanager, suppress
from typing import TypeVar

from server.errors import ElsewhereError
from server.live.rooms.rooms import Rooms
from server.records.room_leases import RoomLeases
from server.running.leave import Leave
from worker.database.faults import AWAY, Complaint

log = logging.getLogger(__name__)

EVERY_S = 1.0
Asked = TypeVar("Asked")
T = TypeVar("T")


class Keeper:
    """Holds the leases of this server's rooms. Used from the event loop only.

    Args:
        leave: when the server takes leave its rooms are anybody's.
        threads: that leases are taken in; nothing slow may run there.
    """

    def __init__(self, rooms: Rooms, leases: RoomLeases, leave: Leave, threads: Executor) -> None:
        self._threads = threads
        self._rooms, self._leases, self._leave = rooms, leases, leave
        self._sessions, self._has_leases = Counter[str](), False
        self._alone = asyncio.Lock()  # what is taken is not given up by a round that has not heard of it
        self._complaint = Complaint(log, "which server has a room cannot be told")

    @asynccontextmanager
    async def having(self, prefix: str) -> AsyncIterator[None]:
        """For as long as a session is in a room whose name begins so, or tries to be.

        Raises ElsewhereError where another server has these rooms.
        """
        self._sessions[prefix] += 1
        try:
            if not await self._take(prefix):
                raise ElsewhereError("another server has this room; come to it by way of the balancer, or try again")
            yield
        finally:
            self._sessions[prefix] -= 1
            if not self._sessions[prefix]:
                del self._sessions[prefix]

    async def _take(self, prefix: str) -> bool:
        async with self._alone:
            self._has_leases = True
            try:
                return await self._ask(self._leases.take, prefix)
            except AWAY as error:  # the next round tries again
                self._complaint.meet(error)
                return True

    async def run(self) -> None:
        """Keep what there is until the server takes leave."""
        while not self._leave.is_taken:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._leave.taken(), EVERY_S)
            await self.look()

    async def look(self) -> None:
        """Keep what there is, if anything; who is in a room that another server has meanwhile has to go there."""
        async with self._alone:
            held = set() if self._leave.is_taken else {*self._sessions, *self._rooms.prefixes()}
            if not held and not self._has_leases:
                return
            try:
                lost = await self._ask(self._leases.keep, held)
                self._has_leases = bool(held)
                self._complaint.well()
            except Exception as error:  # the database may be away for a while; the next look must come
                self._complaint.meet(error)
                return
        for prefix in lost:
            self._rooms.lose(prefix)

    async def _ask(self, question: Callable[[Asked], T], about: Asked) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._threads, question, about)

    async def close(self) -> None:
        """Give up all."""
        with suppress(*AWAY):  # then the leases run out
            await self._ask(self._leases.keep, ())
