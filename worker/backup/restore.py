"""Puts a backup into an empty data directory and an empty ledger.

A mark stands in the directory until all is there, and nothing works on one that has it; the same restore goes on there.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from relume.errors import BackupError, DiskFullError
from relume.folders import folder_bytes
from relume.replacing import UNFINISHED, replacing
from worker.backup.ledger_copy import fill_ledger, is_empty
from worker.backup.shelf import Kept, Shelf, Snapshot, Tell, copy_verified
from worker.backup.take import Begin
from worker.database import open_database

MARK = "restoring.json"


def refuse_unfinished(data_dir: Path) -> None:
    """Raise BackupError where a restore into a data directory was begun and is not finished."""
    if (data_dir / MARK).exists():
        raise BackupError(
            f"a restore into {data_dir} was not finished; run relume restore again, which goes on, or empty the folder"
        )


def restore(
    shelf: Shelf, name: str | None, data_dir: Path, ledger_url: str, begin: Begin = lambda total: lambda done: None
) -> tuple[Snapshot, Sequence[str]]:
    """Restore a snapshot, every file of it checked. Of what has damaged files nothing is restored, as nothing is
    backed up: one bake must not cost all others, and what the ledger names and is not there is made again.

    Args:
        shelf: the folder of backups. name: of the snapshot; None: the newest.
        data_dir: empty or missing, or where the same restore was interrupted. ledger_url: of an empty ledger.
        begin: hears of progress.
    Returns:
        The snapshot, and a sentence for each thing that is damaged in the backup.
    Raises:
        BackupError: there is no such backup, its ledger is damaged, or there is something where it should go.
        DiskFullError: there is no room for it.
    """
    snapshot = shelf.read(name)
    _mark(shelf, snapshot, data_dir, ledger_url)
    num_bytes = sum(kept.num_bytes for kept in snapshot.files)
    if num_bytes > shutil.disk_usage(data_dir).free + folder_bytes(data_dir):
        raise DiskFullError(f"a backup of {num_bytes / 1e6:,.0f} MB")
    tell = begin(num_bytes)
    lost = {kept.thing for kept in snapshot.files if not _put(shelf, kept, data_dir / kept.path, tell)}
    for thing in lost:
        _forget(data_dir / thing)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "ledger.db"
        if not _put(shelf, snapshot.ledger, copy, lambda done: None):
            raise BackupError("the ledger is damaged in the backup; empty the folder, and restore an older one")
        target = open_database(ledger_url)
        try:
            if is_empty(target):  # else the restore was killed after this, which is all or nothing
                fill_ledger(copy, target)
        finally:
            target.dispose()
    for leftover in data_dir.rglob(UNFINISHED):  # of restores that were killed
        leftover.unlink(missing_ok=True)
    (data_dir / MARK).unlink()
    return snapshot, [f"{thing} is damaged in the backup: bake or import it again" for thing in sorted(lost)]


def _mark(shelf: Shelf, snapshot: Snapshot, data_dir: Path, ledger_url: str) -> None:
    """Say in the data directory what is restored into it; refuse where something else is."""
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    mark, document = data_dir / MARK, {"from": str(shelf.folder.resolve()), "snapshot": snapshot.name}
    if mark.exists():
        begun = json.loads(mark.read_text(encoding="utf-8"))
        if begun != document:
            raise BackupError(
                f"the restore of {begun['snapshot']} into {data_dir} was not finished; go on with that one"
            )
        return
    if any(data_dir.iterdir()):
        raise BackupError(f"{data_dir} is not empty; restore into an empty folder (--data)")
    with replacing(mark) as unfinished:
        unfinished.write_text(json.dumps(document))
    engine = open_database(ledger_url)
    try:
        if not is_empty(engine):
            mark.unlink()
            raise BackupError("the ledger has rows already; restore into an empty database (RELUME_DATABASE)")
    finally:
        engine.dispose()


def _forget(thing: Path) -> None:
    if thing.is_dir():
        shutil.rmtree(thing)
    thing.unlink(missing_ok=True)


def _put(shelf: Shelf, kept: Kept, target: Path, tell: Tell) -> bool:
    """Whether a file is there as it was."""
    if target.exists() and target.stat().st_size == kept.num_bytes:  # put there before an interruption, whole
        tell(kept.num_bytes)
        return True
    target.parent.mkdir(parents=True, exist_ok=True)
    source = shelf.path_of(kept.sha256)
    return source.is_file() and copy_verified(source, target, kept.sha256, tell)
