"""Release a process's caches between tasks after some idle time."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

DEFAULT_IDLE_S = 60.0


def idle_seconds() -> float:
    """Lifetime of unused data in seconds: `RELUME_IDLE_SECONDS`, which worker processes inherit."""
    try:
        return max(1.0, float(os.environ.get("RELUME_IDLE_SECONDS", "")))
    except ValueError:
        return DEFAULT_IDLE_S


class IdleTimer:
    """Calls `release` after `after_s()` idle seconds. Thread-safe."""

    def __init__(self, after_s: Callable[[], float], release: Callable[[], None]) -> None:
        self._after_s, self._release = after_s, release
        self._lock = threading.Lock()
        self._num_active = 0
        self._timer: threading.Timer | None = None

    @contextmanager
    def keep_awake(self) -> Iterator[None]:
        """Keep everything inside the block, and for a while afterwards."""
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
        """Stop the timer: nothing is released until the process ends."""
        with self._lock:
            self._stop()

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
