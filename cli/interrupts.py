"""Ctrl-C that takes effect where it is asked for."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import TypeVar

Made = TypeVar("Made")


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


def until_interrupted(what: str, work: Callable[[Callable[[float], object], Callable[[], bool]], Made]) -> Made:
    """Do long work with a bar in the terminal, its rate and the time that is left.

    Args:
        what: it is, in words. work: told whom to tell the share that is done, and whom to ask whether to stop.
    Raises:
        KeyboardInterrupt: it was interrupted, and has stopped.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from relume.errors import CancelledError

    columns = (
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with noted_interrupts() as asked, Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task(what, total=1.0)
        try:
            return work(lambda share: progress.update(bar, completed=share), asked.is_set)
        except CancelledError:
            raise KeyboardInterrupt from None
