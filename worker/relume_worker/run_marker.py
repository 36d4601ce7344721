"""Which unfinished store the finished tasks of a bake are in: machines that share a ledger need not share a folder.

Whoever begins a bake from nothing names that beginning, in the ledger and in a file beside the unfinished store. Where
the two differ, the ledger's tasks are in another machine's folder, or in object storage
(`relume_worker.storage.partial_uploads`).
"""

from __future__ import annotations

import uuid
from contextlib import suppress
from pathlib import Path

from relume.core.filesystem import atomic_write


def start_run(staging: Path) -> str:
    """Name a beginning, beside the unfinished store that it will be in."""
    run = uuid.uuid4().hex
    set_run(staging, run)
    return run


def set_run(staging: Path, run: str) -> None:
    """Say which beginning an unfinished store is of."""
    staging.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(_path(staging)) as unfinished:
        unfinished.write_text(run)


def get_run(staging: Path) -> str | None:
    """The name; None where there is none, or from before there were any."""
    try:
        return _path(staging).read_text()
    except OSError:
        return None


def delete_run(staging: Path) -> None:
    """Remove the name, where there is one."""
    with suppress(OSError):
        _path(staging).unlink(missing_ok=True)


def _path(staging: Path) -> Path:
    return staging.with_suffix(".run")
