"""The freeze of a session: at most one runs, in a thread of its own, and the pictures go on being painted."""

from __future__ import annotations

import asyncio
import threading
import time
from dataclasses import dataclass
from typing import Any

from relume.errors import CancelledError
from server.live.ports import Need
from server.live.threads import Threads
from server.live.viewport import Viewport
from server.live.wire import Wire
from server.metrics import Metrics
from server.protocol import StatusMessage

STATUS_S = 0.100


@dataclass(frozen=True)
class _Running:
    """A freeze from its start until its result is taken."""

    viewport: Viewport
    need: Need
    future: asyncio.Future[Any]
    telling: asyncio.Task[None]
    start_s: float


class Freezer:
    """Starts a need, says how far it is, and hands out what it made; `news` is set when there is something to take."""

    def __init__(self, wire: Wire, threads: Threads, metrics: Metrics, news: asyncio.Event) -> None:
        self._wire, self._threads, self._metrics, self._news = wire, threads, metrics, news
        self._running: _Running | None = None
        self._cancel = threading.Event()

    @property
    def running(self) -> tuple[Viewport, Need] | None:
        """What is being made, and for which view."""
        return None if self._running is None else (self._running.viewport, self._running.need)

    @property
    def is_done(self) -> bool:
        """Whether there is something to take."""
        return self._running is not None and self._running.telling.done()

    def start(self, viewport: Viewport, need: Need) -> None:
        """Begin; nothing may be running."""
        self._cancel = cancel = threading.Event()
        progress = [0.0]
        future = asyncio.wrap_future(
            self._threads.long.submit(need.make, lambda share: progress.__setitem__(0, share), cancel.is_set)
        )
        telling = asyncio.create_task(self._tell(future, viewport.name, need, progress))
        telling.add_done_callback(lambda _: self._news.set())
        self._running = _Running(viewport, need, future, telling, time.perf_counter())

    def cancel(self) -> None:
        """What runs is not wanted any more: it ends soon."""
        self._cancel.set()

    async def take(self) -> tuple[Viewport, Need, Any] | None:
        """What was made, when `is_done`; None where it was cancelled. Raises what making it raised."""
        running = self._running
        if running is None:
            return None
        await running.telling  # where the client is gone, `end` still has a thread to wait for
        self._running = None
        error = running.future.exception()
        if isinstance(error, CancelledError):
            return None
        if error is not None:
            raise error
        self._metrics.freeze.observe(time.perf_counter() - running.start_s)
        return running.viewport, running.need, running.future.result()

    async def end(self) -> None:
        """Cancel what runs and wait for its thread; nobody asks for its result any more."""
        self._cancel.set()
        if self._running is None:
            return
        running, self._running = self._running, None
        running.telling.cancel()
        await asyncio.wait({running.telling, running.future})
        for part in (running.telling, running.future):
            if not part.cancelled():
                part.exception()

    async def _tell(self, future: asyncio.Future[Any], view: str, need: Need, progress: list[float]) -> None:
        """Say how far it is, each per cent once."""
        told = -1.0
        while not future.done():
            shown = round(min(1.0, max(0.0, progress[0])), 2)
            if shown != told:
                told = shown
                await self._wire.send(StatusMessage(state=need.state, view=view, what=need.what, progress=shown))
            await asyncio.wait({future}, timeout=STATUS_S)
        await self._wire.send(StatusMessage(state="ready", view=view, what=need.what, progress=progress[0]))
