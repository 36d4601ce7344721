"""Comments that other servers took: rooms are told of those, too, a moment later."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Executor

from relume_server.collaboration.rooms import Rooms
from relume_worker.database.failures import DatabaseError

log = logging.getLogger(__name__)

POLL_INTERVAL_S = 2.0
Marks = Mapping[str, object]
"""By scene, what is another one whenever its comments are."""


class CommentSync:
    """Looks again and again, for as long as the server runs; the database is asked only while there are rooms.

    Args:
        marks: of some scenes. threads: that they are asked for in; nothing slow may run there.
    """

    def __init__(self, rooms: Rooms, marks: Callable[[Collection[str]], Marks], threads: Executor) -> None:
        self._rooms, self._marks, self._threads = rooms, marks, threads
        self._last_marks: Marks = {}
        self._outage = DatabaseError(log, "whether there are new comments cannot be told")

    async def run(self) -> None:
        """Look for ever."""
        while True:
            await asyncio.sleep(POLL_INTERVAL_S)
            try:
                await self.refresh()
                self._outage.report_recovered()
            except Exception as error:  # the database may be away for a while; the next look must come
                self._outage.report_failure(error)

    async def refresh(self) -> None:
        """Tell the rooms of those scenes whose comments have changed since the last look."""
        scenes = self._rooms.scenes()
        ask = asyncio.get_running_loop().run_in_executor
        before, self._last_marks = self._last_marks, await ask(self._threads, self._marks, scenes) if scenes else {}
        for scene, mark in self._last_marks.items():
            if scene in before and before[scene] != mark:
                self._rooms.notify_comment(scene)
