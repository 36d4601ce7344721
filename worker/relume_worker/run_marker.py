"""Run markers tie finished tasks to an unfinished store: machines that share a ledger need not share a folder.

The process that starts a bake from nothing stores a new marker in the ledger and in a file next to the unfinished
store. If the two differ, the ledger's tasks are in another machine's folder, or in object storage
(`relume_worker.storage.partial_uploads`).
"""

from __future__ import annotations

import uuid
from contextlib import suppress
from pathlib import Path

from relume.core.filesystem import atomic_write


def start_run(staging: Path) -> str:
    """Create a marker next to a new unfinished store."""
    run = uuid.uuid4().hex
    set_run(staging, run)
    return run


def set_run(staging: Path, run: str) -> None:
    """Set the marker of an unfinished store."""
    staging.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(_path(staging)) as unfinished:
        unfinished.write_text(run)


def get_run(staging: Path) -> str | None:
    """Read the marker; None if there is none, or the store is older than markers."""
    try:
        return _path(staging).read_text()
    except OSError:
        return None


def delete_run(staging: Path) -> None:
    """Remove the marker, if there is one."""
    with suppress(OSError):
        _path(staging).unlink(missing_ok=True)


def _path(staging: Path) -> Path:
    return staging.with_suffix(".run")
