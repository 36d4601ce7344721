"""uvicorn with draining: SIGTERM lets sessions move first, and the process ends within a time limit."""

from __future__ import annotations

import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Callable
from types import FrameType

import uvicorn

from relume_server.lifecycle.drain import DrainState

log = logging.getLogger(__name__)


class ServerProcess(uvicorn.Server):
    """Runs the app until it is stopped: by SIGTERM after its sessions have left, by SIGINT or a second SIGTERM at once.

    Args:
        config: config of uvicorn. drain: state for sessions and /readyz. num_sessions: number of open sessions.
        drain_seconds: time limit for sessions to leave. stop_seconds: time limit for everything else afterwards.
        on_started: called once requests are answered. end: ends this process unconditionally.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        *,
        drain: DrainState,
        num_sessions: Callable[[], int],
        drain_seconds: float,
        stop_seconds: float,
        on_started: Callable[[], object] = lambda: None,
        end: Callable[[int], object] = os._exit,
    ) -> None:
        super().__init__(config)
        self._drain, self._num_sessions = drain, num_sessions
        self._on_started, self._end = on_started, end
        self._drain_seconds, self._stop_seconds = drain_seconds, stop_seconds
        self._until_s: float | None = None
        self._signal: int | None = None
        self._timer = threading.Timer(stop_seconds, self._give_up)
        self._timer.daemon = True

    def run(self, sockets: list[socket.socket] | None = None) -> None:
        """Run until it is stopped; blocks."""
        try:
            super().run(sockets)
        finally:
            self._timer.cancel()  # the caller may continue

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Open the app's services, then listen."""
        await super().startup(sockets)
        if self.started:
            self._on_started()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Handle a signal; the first SIGTERM is left to `on_tick`, on the event loop."""
        if sig == signal.SIGTERM and self._signal is None and self.started:
            self._signal = sig
        else:
            super().handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Run every 0.1 s: start draining if requested, and end when all sessions have left.

        Work that does not stop in time is abandoned: the database knows the finished tasks.
        """
        if self._signal is not None and not self.should_exit:
            if self._until_s is None:
                self._until_s = time.monotonic() + self._drain_seconds
                log.warning("stopping: draining %d sessions", self._num_sessions())
                self._drain.start()
            if self._num_sessions() == 0 or time.monotonic() > self._until_s:
                super().handle_exit(self._signal, None)
        should_exit = await super().on_tick(counter)
        if should_exit:
            self._timer.start()
        return should_exit

    def _give_up(self) -> None:
        text = "not stopped after %g s; exiting anyway, unfinished work resumes at the next start"
        log.error(text, self._stop_seconds)
        self._end(1)
