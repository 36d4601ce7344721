"""Notify sessions when a finer bake of the scene is running or ready, so that the editor can switch to it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor

from relume_server.client_state.socket import ClientSocket
from relume_server.schemas.protocol import BakeMessage
from relume_worker.database.failures import DATABASE_ERRORS, DatabaseError
from relume_worker.status import BakeStatus

log = logging.getLogger(__name__)
POLL_S = 0.5


class BakeUpdates:
    """Polls the database, which other processes change as well: once for all sessions of a scene.

    Args:
        list_bakes: returns the bakes of a scene. threads: threads for the query; for short work only.
    """

    def __init__(self, list_bakes: Callable[[str], Sequence[BakeStatus]], threads: Executor) -> None:
        self._list_bakes, self._threads = list_bakes, threads
        self._queries: dict[str, tuple[float, asyncio.Task[Sequence[BakeStatus]]]] = {}
        self._outage = DatabaseError(log, "sessions are not notified of finer bakes")

    async def send_updates(self, socket: ClientSocket, bake: str, scene: str) -> None:
        """Send each change once, while the session runs."""
        last_messages: dict[str, BakeMessage] = {}
        while True:
            for message in self._messages(bake, await self._list_recent(scene)):
                if last_messages.get(message.bake) != message:
                    last_messages[message.bake] = message
                    await socket.send(message)
            await asyncio.sleep(POLL_S)

    async def _list_recent(self, scene: str) -> Sequence[BakeStatus]:
        """Bakes of a scene, from a recent query of any session or a new one."""
        now_s = time.monotonic()
        self._queries = {
            scene_id: query
            for scene_id, query in self._queries.items()
            if now_s < query[0] + POLL_S or not query[1].done()
        }
        if scene not in self._queries:
            self._queries[scene] = now_s, asyncio.create_task(self._ask(scene))
        return await asyncio.shield(self._queries[scene][1])  # one session's end does not cancel it for others

    async def _ask(self, scene: str) -> Sequence[BakeStatus]:
        try:
            statuses = await asyncio.get_running_loop().run_in_executor(self._threads, self._list_bakes, scene)
        except DATABASE_ERRORS as error:  # ignored for a while; images do not depend on it
            self._outage.report_failure(error)
            return ()
        self._outage.report_recovered()
        return statuses

    @staticmethod
    def _messages(bake: str, statuses: Sequence[BakeStatus]) -> list[BakeMessage]:
        current = next((status for status in statuses if status.id == bake), None)
        return [
            BakeMessage(
                bake=status.id,
                replaces=bake,
                state=status.state,
                progress=round(status.progress, 3),
                phase=status.phase,
                seconds_left=None if status.seconds_left is None else round(status.seconds_left, 1),
            )
            for status in statuses
            if current is not None and status.state in ("running", "ready") and status.rank > current.rank
        ]
