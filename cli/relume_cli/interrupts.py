"""Ctrl-C that is polled instead of raised."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import TypeVar

Made = TypeVar("Made")


@contextlib.contextmanager
def capture_interrupts() -> Iterator[threading.Event]:
    """Yield an event that is set instead of raising KeyboardInterrupt; main thread only.

    If it were raised during an import, the interpreter's import lock could stay locked, and the baking threads and this
    one would wait for each other.
    """
    interrupted = threading.Event()
    previous_handler = signal.signal(signal.SIGINT, lambda *_: interrupted.set())
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, previous_handler)


def until_interrupted(label: str, work: Callable[[Callable[[float], object], Callable[[], bool]], Made]) -> Made:
    """Do long work and show its progress.

    Args:
        label: label of the work.
        work: called with a function that reports the fraction done, and one that returns true to
            stop.
    Raises:
        KeyboardInterrupt: the work was interrupted, and has stopped.
    """
    from relume.core.errors import CancelledError
    from relume_cli.terminal.progress import progress

    with capture_interrupts() as interrupted, progress(label) as report:
        try:
            return work(report, interrupted.is_set)
        except CancelledError:
            raise KeyboardInterrupt from None
