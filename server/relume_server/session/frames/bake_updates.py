"""Notify sessions when a finer bake of the scene is running or ready, so that the editor can switch to it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor

from relume_server.client_state.socket import ClientSocket
from relume_server.runtime.shared_poll import SharedPoll
from relume_server.schemas.protocol import BakeMessage
from relume_worker.database.failures import DATABASE_ERRORS, DatabaseError
from relume_worker.status import BakeStatus

log = logging.getLogger(__name__)
POLL_S = 0.5


class BakeUpdates:
    """Polls the database, which other processes change as well: by one query for the scenes of all sessions.

    Args:
        list_bakes: returns the bakes of some scenes. threads: threads for the query; for short work only.
    """

    def __init__(
        self, list_bakes: Callable[[Collection[str]], Mapping[str, Sequence[BakeStatus]]], threads: Executor
    ) -> None:
        self._list_bakes, self._threads = list_bakes, threads
        self._poll = SharedPoll(self._ask, lambda: POLL_S)
        self._outage = DatabaseError(log, "sessions are not notified of finer bakes")

    async def send_updates(self, socket: ClientSocket, bake: str, scene: str) -> None:
        """Send each change once, while the session runs."""
        last_messages: dict[str, BakeMessage] = {}
        with self._poll.following(scene):
            while True:
                for message in self._messages(bake, await self._poll.next(scene) or ()):
                    if last_messages.get(message.bake) != message:
                        last_messages[message.bake] = message
                        await socket.send(message)

    async def _ask(self, scenes: Collection[str]) -> Mapping[str, Sequence[BakeStatus]]:
        try:
            statuses = await asyncio.get_running_loop().run_in_executor(self._threads, self._list_bakes, scenes)
        except DATABASE_ERRORS as error:  # ignored for a while; images do not depend on it
            self._outage.report_failure(error)
            return {}
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
