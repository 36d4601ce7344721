"""What a process keeps between tasks is forgotten when no task has come for a while."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

DEFAULT_IDLE_S = 60.0


def idle_seconds() -> float:
    """How long things that nobody uses are kept: `RELUME_IDLE_SECONDS`, which worker processes inherit."""
    try:
        return max(1.0, float(os.environ.get("RELUME_IDLE_SECONDS", "")))
    except ValueError:
        return DEFAULT_IDLE_S


class IdleTimer:
    """Calls `release` once nothing has been at work for `after_s()` seconds; safe to use from several threads."""

    def __init__(self, after_s: Callable[[], float], release: Callable[[], None]) -> None:
        self._after_s, self._release = after_s, release
        self._lock = threading.Lock()
        self._num_active = 0
        self._timer: threading.Timer | None = None

    @contextmanager
    def keep_awake(self) -> Iterator[None]:
        """Nothing is forgotten while the block runs, and for a while after it."""
        with self._lock:
            self._num_active += 1
            self._stop()
        try:
            yield
        finally:
            with self._lock:
                self._num_active -= 1
                if self._num_active == 0:
                    self._timer = threading.Timer(self._after_s(), self._release)
                    self._timer.daemon = True
                    self._timer.start()

    def end(self) -> None:
        """What is kept is kept until the process ends: nobody will ask for more."""
        with self._lock:
            self._stop()

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
