"""What the processes of a bake are at before any of their tasks is done, which can take a minute.

A process that runs a task notes what it is at in a file beside the unfinished store, which every process of a cluster
sees; whoever runs the bake reads it at each heartbeat.
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
    """The file of notes beside an unfinished store."""
    return staging.with_suffix(".phase")


def read_note(staging: Path) -> Activity | None:
    """What was noted last; None where nothing was."""
    try:
        text = note_path(staging).read_text()
    except OSError:
        return None
    return next((note for note in _ACTIVITIES if note == text), None)


def delete_note(staging: Path) -> None:
    """Remove it, where there is one."""
    with suppress(OSError):
        note_path(staging).unlink(missing_ok=True)


class TaskNotes:
    """Notes of one task; kernels that are compiled meanwhile are noted as well."""

    def __init__(self, staging: Path) -> None:
        self._path = note_path(staging)
        self._latest: Activity | None = None

    def note(self, activity: Activity) -> None:
        """Say what the process is at. A disk that is full or read-only costs the words alone."""
        self._latest = activity
        self._write(activity)

    def _write(self, activity: Activity) -> None:
        with suppress(RelumeError), atomic_write(self._path) as unfinished:
            unfinished.write_text(activity)

    @contextmanager
    def watching_compiler(self) -> Iterator[None]:
        """While the block runs, kernels that this process compiles are noted."""
        listener = _CompileListener(self)
        event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
        try:
            yield
        finally:
            event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]

    def set_compiling(self, is_compiling: bool) -> None:
        """A kernel is being compiled, or was: what was noted before goes on."""
        if is_compiling:
            self._write("compiling")
        elif self._latest is not None:
            self._write(self._latest)


class _CompileListener(event.Listener):
    """Kernels that call others are compiled with them: the outermost counts."""

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
