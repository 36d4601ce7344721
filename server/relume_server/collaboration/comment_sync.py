"""Notify rooms of comments that other servers stored."""

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
"""A value per scene that changes with its comments."""


class CommentSync:
    """Polls while the server runs; the database is queried only while there are rooms.

    Args:
        rooms: rooms of this server. marks: marks of some scenes. threads: threads for the query; for short work only.
    """

    def __init__(self, rooms: Rooms, marks: Callable[[Collection[str]], Marks], threads: Executor) -> None:
        self._rooms, self._marks, self._threads = rooms, marks, threads
        self._last_marks: Marks = {}
        self._outage = DatabaseError(log, "new comments cannot be read")

    async def run(self) -> None:
        """Poll forever."""
        while True:
            await asyncio.sleep(POLL_INTERVAL_S)
            try:
                if await self.refresh():
                    self._outage.report_recovered()
            except Exception as error:  # the task must survive an unavailable database
                self._outage.report_failure(error)

    async def refresh(self) -> bool:
        """Notify the rooms of scenes whose comments changed since the last poll; false if there are no rooms."""
        scenes = self._rooms.scenes()
        ask = asyncio.get_running_loop().run_in_executor
        before, self._last_marks = self._last_marks, await ask(self._threads, self._marks, scenes) if scenes else {}
        for scene, mark in self._last_marks.items():
            if scene in before and before[scene] != mark:
                self._rooms.notify_comment(scene)
        return bool(scenes)
