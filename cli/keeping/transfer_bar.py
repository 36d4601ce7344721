"""Shows how far a copy is: bytes, rate, time left."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn, TransferSpeedColumn


@contextmanager
def transfer_bar(label: str) -> Iterator[Callable[[int], Callable[[int], None]]]:
    """Yields what begins a bar of so many bytes, in place of the one before, and returns whom to tell of copies."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn()
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task(label, total=None)

        def begin(num_bytes: int) -> Callable[[int], None]:
            progress.reset(bar, total=num_bytes)
            return lambda done: progress.advance(bar, done)

        yield begin
