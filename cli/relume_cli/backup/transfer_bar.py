"""Shows how far a copy is, in bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from relume_cli.terminal.printing import size_text
from relume_cli.terminal.progress import progress


@contextmanager
def transfer_bar(label: str) -> Iterator[Callable[[int], Callable[[int], None]]]:
    """Yields what begins a bar of so many bytes, in place of the one before, and returns whom to tell of copies."""
    with progress(label) as tell:

        def start_report(num_bytes: int) -> Callable[[int], None]:
            done = 0

            def advance(more: int) -> None:
                nonlocal done
                done += more
                tell(done / max(1, num_bytes), f"{size_text(done)} of {size_text(num_bytes)}")

            return advance

        yield start_report
