"""Ctrl-C that takes effect where it is asked for."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import TypeVar

Made = TypeVar("Made")


@contextlib.contextmanager
def capture_interrupts() -> Iterator[threading.Event]:
    """The event is set where Python would raise KeyboardInterrupt; for the main thread alone.

    Raised between two lines of an import it may leave the interpreter's import lock held for ever, and then the threads
    that bake wait for it and this one waits for them.
    """
    interrupted = threading.Event()
    previous_handler = signal.signal(signal.SIGINT, lambda *_: interrupted.set())
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, previous_handler)


def until_interrupted(label: str, work: Callable[[Callable[[float], object], Callable[[], bool]], Made]) -> Made:
    """Do long work and show how far it is.

    Args:
        label: it is, in words. work: told whom to tell the share that is done, and whom to ask whether to stop.
    Raises:
        KeyboardInterrupt: it was interrupted, and has stopped.
    """
    from relume.core.errors import CancelledError
    from relume_cli.terminal.progress import progress

    with capture_interrupts() as interrupted, progress(label) as report:
        try:
            return work(report, interrupted.is_set)
        except CancelledError:
            raise KeyboardInterrupt from None
