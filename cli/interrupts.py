"""Ctrl-C that takes effect where it is asked for."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def noted_interrupts() -> Iterator[threading.Event]:
    """The event is set where Python would raise KeyboardInterrupt; for the main thread alone.

    Raised between two lines of an import it may leave the interpreter's import lock held for ever, and then the threads
    that bake wait for it and this one waits for them.
    """
    asked = threading.Event()
    before = signal.signal(signal.SIGINT, lambda *_: asked.set())
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)
