"""Progress of a copy, in bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from relume.core.errors import bytes_text
from relume_cli.terminal.progress import progress


@contextmanager
def transfer_bar(label: str) -> Iterator[Callable[[int], Callable[[int], None]]]:
    """Yield a function that starts a bar of so many bytes and returns a function that advances it."""
    with progress(label) as report:

        def start_report(num_bytes: int) -> Callable[[int], None]:
            done = 0

            def advance(num_copied: int) -> None:
                nonlocal done
                done += num_copied
                report(done / max(1, num_bytes), f"{bytes_text(done)} of {bytes_text(num_bytes)}")

            return advance

        yield start_report
