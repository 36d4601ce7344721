"""Progress of long work: a bar in a terminal, otherwise a line now and then; nothing with --quiet."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

import typer

from relume_cli.terminal.printing import is_quiet

LINE_STEP, MAX_INTERVAL_S, MIN_INTERVAL_S = 0.1, 30.0, 2.0
"""A line for each tenth and each half minute, at least two seconds apart."""


class ReportProgress(Protocol):
    """Reports the fraction done, 0 to 1, and the current step as text."""

    def __call__(self, share: float, detail: str = "", /) -> None: ...


def report_part(report: ReportProgress, index: int, total: int, detail: str) -> ReportProgress:
    """Return a callback that reports one part of a larger work.

    Args:
        report: report of the whole work. index, total: index and total of the part.
        detail: text for the part, unless it has a more precise one.
    """

    def report_share(share: float, own_detail: str = "") -> None:
        report((index + share) / total, own_detail or detail)

    return report_share


class ProgressLines:
    """Progress as lines, for logs."""

    def __init__(self, label: str, write: Callable[[str], object], clock: Callable[[], float] = time.monotonic) -> None:
        """
        Args:
            label: label of the work. write: takes a line. clock: seconds.
        """
        self._label, self._write, self._clock = label, write, clock
        self._last_s, self._step = clock(), 0

    def __call__(self, share: float, detail: str = "") -> None:
        """Write a line if one is due."""
        since_s, step = self._clock() - self._last_s, math.floor(share / LINE_STEP + 1e-9)
        self._step = min(self._step, step)  # the work may restart
        if since_s < MIN_INTERVAL_S or (step == self._step and since_s < MAX_INTERVAL_S):
            return
        self._write(f"{self._label}: {share:.0%}" + (f", {detail}" if detail else ""))
        self._last_s += since_s
        self._step = step


@contextmanager
def progress(label: str) -> Iterator[ReportProgress]:
    """Show progress on stderr; yield the function that reports it."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if is_quiet.get():
        yield lambda share, detail="": None
    elif not console.is_terminal:
        yield ProgressLines(label, lambda line: typer.echo(line, err=True))
    else:
        columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
        with Progress(*columns, TextColumn("{task.fields[detail]}"), console=console, transient=True) as bars:
            bar = bars.add_task(label, total=1.0, detail="")
            yield lambda share, detail="": bars.update(bar, completed=share, detail=detail)
