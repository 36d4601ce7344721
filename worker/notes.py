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

from relume.errors import RelumeError
from relume.replacing import replacing

Note = Literal["reading", "building", "compiling", "working"]

_NOTES: tuple[Note, ...] = ("reading", "building", "compiling", "working")


def note_path(staging: Path) -> Path:
    """The file of notes beside an unfinished store."""
    return staging.with_suffix(".phase")


def read_note(staging: Path) -> Note | None:
    """What was noted last; None where nothing was."""
    try:
        text = note_path(staging).read_text()
    except OSError:
        return None
    return next((note for note in _NOTES if note == text), None)


def forget_note(staging: Path) -> None:
    """Remove it, where there is one."""
    with suppress(OSError):
        note_path(staging).unlink(missing_ok=True)


class Notebook:
    """Notes of one task; kernels that are compiled meanwhile are noted as well."""

    def __init__(self, staging: Path) -> None:
        self._path = note_path(staging)
        self._latest: Note | None = None

    def note(self, what: Note) -> None:
        """Say what the process is at. A disk that is full or read-only costs the words alone."""
        self._latest = what
        self._write(what)

    def _write(self, what: Note) -> None:
        with suppress(RelumeError), replacing(self._path) as unfinished:
            unfinished.write_text(what)

    @contextmanager
    def watching_compiler(self) -> Iterator[None]:
        """While the block runs, kernels that this process compiles are noted."""
        listener = _Compiling(self)
        event.register("numba:compile", listener)  # type: ignore[no-untyped-call]
        try:
            yield
        finally:
            event.unregister("numba:compile", listener)  # type: ignore[no-untyped-call]

    def compiling(self, is_so: bool) -> None:
        """A kernel is being compiled, or was: what was noted before goes on."""
        if is_so:
            self._write("compiling")
        elif self._latest is not None:
            self._write(self._latest)


class _Compiling(event.Listener):
    """Kernels that call others are compiled with them: the outermost counts."""

    def __init__(self, notes: Notebook) -> None:
        self._notes, self._depth = notes, 0

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth == 1:
            self._notes.compiling(True)

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._notes.compiling(False)
