"""uvicorn, with a drain before its end: SIGTERM lets sessions go first, and the process ends within a bound."""

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
        drain: what sessions and /readyz hear of. num_sessions: that are open.
        drain_seconds: how long they may take to leave. stop_seconds: how long all else may take after that.
        on_started: called once requests are answered. end: ends this process, whatever it does.
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
            self._timer.cancel()  # whoever ran it may go on

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Open what the app needs, then listen."""
        await super().startup(sockets)
        if self.started:
            self._on_started()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """A signal has come: the first SIGTERM is seen to by `on_tick`, on the event loop."""
        if sig == signal.SIGTERM and self._signal is None and self.started:
            self._signal = sig
        else:
            super().handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Every tenth of a second: take leave where that is asked for, and end when all have left.

        What does not stop in time after that is left: the ledger knows what is finished.
        """
        if self._signal is not None and not self.should_exit:
            if self._until_s is None:
                self._until_s = time.monotonic() + self._drain_seconds
                log.warning("stopping: %d sessions are told to leave", self._num_sessions())
                self._drain.start()
            if self._num_sessions() == 0 or time.monotonic() > self._until_s:
                super().handle_exit(self._signal, None)
        should_exit = await super().on_tick(counter)
        if should_exit:
            self._timer.start()
        return should_exit

    def _give_up(self) -> None:
        text = "not stopped after %g s; ending all the same, what was under way goes on at the next start"
        log.error(text, self._stop_seconds)
        self._end(1)
