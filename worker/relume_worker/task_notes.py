"""Activity of a bake's processes before the first task is done, which can take a minute.

A process that runs a task writes its activity into a file next to the unfinished store, visible to all processes of a
cluster; the runner of the bake reads it at each heartbeat.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from numba.core import event

from relume.core.errors import RelumeError
from relume.core.filesystem import atomic_write

Activity = Literal["reading", "building", "compiling", "working"]

_ACTIVITIES: tuple[Activity, ...] = ("reading", "building", "compiling", "working")


def note_path(staging: Path) -> Path:
    """Status file next to an unfinished store."""
    return staging.with_suffix(".phase")


def read_note(staging: Path) -> Activity | None:
    """Last activity; None if there is none."""
    try:
        text = note_path(staging).read_text()
    except OSError:
        return None
    return next((note for note in _ACTIVITIES if note == text), None)


def delete_note(staging: Path) -> None:
    """Remove the file, if it exists."""
    with suppress(OSError):
        note_path(staging).unlink(missing_ok=True)


class TaskNotes:
    """Activity of one task, including kernels compiled meanwhile."""

    def __init__(self, staging: Path) -> None:
        self._path = note_path(staging)
        self._latest: Activity | None = None

    def note(self, activity: Activity) -> None:
        """Set the activity. If the disk is full or read-only, only this message is lost."""
        self._latest = activity
        self._write(activity)

    def _write(self, activity: Activity) -> None:
        with suppress(RelumeError), atomic_write(self._path) as unfinished:
            unfinished.write_text(activity)

    @contextmanager
    def watching_compiler(self) -> Iterator[None]:
        """Report compiled kernels inside the block."""
        listener = _CompileListener(self)
        event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
        try:
            yield
        finally:
            event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]

    def set_compiling(self, is_compiling: bool) -> None:
        """Set whether a kernel is being compiled; afterwards the previous activity continues."""
        if is_compiling:
            self._write("compiling")
        elif self._latest is not None:
            self._write(self._latest)


class _CompileListener(event.Listener):
    """Counts nested compilations: kernels that call others are compiled with them."""

    def __init__(self, notes: TaskNotes) -> None:
        self._notes, self._depth = notes, 0

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth == 1:
            self._notes.set_compiling(True)

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._notes.set_compiling(False)
