"""Puts a backup into an empty data directory and an empty ledger.

A mark stands in the directory until all is there, and nothing works on one that has it; the same restore goes on there.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from relume.core.errors import BackupError, DiskFullError
from relume.core.filesystem import UNFINISHED, atomic_write
from relume.core.folder_size import folder_bytes
from relume_worker.backup.create import StartReport
from relume_worker.backup.database_dump import fill_ledger, is_empty
from relume_worker.backup.repository import BackupRepository, ReportBytes, Snapshot, StoredFile, copy_verified
from relume_worker.database import open_database

MARK = "restoring.json"


def refuse_unfinished(data_dir: Path) -> None:
    """Raise BackupError where a restore into a data directory was begun and is not finished."""
    if (data_dir / MARK).exists():
        raise BackupError(
            f"a restore into {data_dir} was not finished; run relume restore again, which goes on, or empty the folder"
        )


def restore(
    repository: BackupRepository,
    name: str | None,
    data_dir: Path,
    ledger_url: str,
    start_report: StartReport = lambda total: lambda done: None,
) -> tuple[Snapshot, Sequence[str]]:
    """Restore a snapshot, every file of it checked. Of what has damaged files nothing is restored, as nothing is
    backed up: one bake must not cost all others, and what the ledger names and is not there is made again.

    Args:
        repository: the folder of backups. name: of the snapshot; None: the newest.
        data_dir: empty or missing, or where the same restore was interrupted. ledger_url: of an empty ledger.
        start_report: hears of progress.
    Returns:
        The snapshot, and a sentence for each thing that is damaged in the backup.
    Raises:
        BackupError: there is no such backup, its ledger is damaged, or there is something where it should go.
        DiskFullError: there is no room for it.
    """
    snapshot = repository.read(name)
    _mark(repository, snapshot, data_dir, ledger_url)
    num_bytes = sum(stored_file.num_bytes for stored_file in snapshot.files)
    if num_bytes > shutil.disk_usage(data_dir).free + folder_bytes(data_dir):
        raise DiskFullError(f"a backup of {num_bytes / 1e6:,.0f} MB")
    report_bytes = start_report(num_bytes)
    damaged = {
        stored_file.content_key
        for stored_file in snapshot.files
        if not _restore_file(repository, stored_file, data_dir / stored_file.path, report_bytes)
    }
    for content_key in damaged:
        _delete(data_dir / content_key)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "ledger.db"
        if not _restore_file(repository, snapshot.ledger, copy, lambda done: None):
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
    return snapshot, [
        f"{content_key} is damaged in the backup: bake or import it again" for content_key in sorted(damaged)
    ]


def _mark(repository: BackupRepository, snapshot: Snapshot, data_dir: Path, ledger_url: str) -> None:
    """Say in the data directory what is restored into it; refuse where something else is."""
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    mark, document = data_dir / MARK, {"from": str(repository.folder.resolve()), "snapshot": snapshot.name}
    if mark.exists():
        existing = json.loads(mark.read_text(encoding="utf-8"))
        if existing != document:
            raise BackupError(
                f"the restore of {existing['snapshot']} into {data_dir} was not finished; go on with that one"
            )
        return
    if any(data_dir.iterdir()):
        raise BackupError(f"{data_dir} is not empty; restore into an empty folder (--data)")
    with atomic_write(mark) as unfinished:
        unfinished.write_text(json.dumps(document))
    engine = open_database(ledger_url)
    try:
        if not is_empty(engine):
            mark.unlink()
            raise BackupError("the ledger has rows already; restore into an empty database (RELUME_DATABASE)")
    finally:
        engine.dispose()


def _delete(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def _restore_file(
    repository: BackupRepository, stored_file: StoredFile, target: Path, report_bytes: ReportBytes
) -> bool:
    """Whether a file is there as it was."""
    if target.exists() and target.stat().st_size == stored_file.num_bytes:  # put there before an interruption, whole
        report_bytes(stored_file.num_bytes)
        return True
    target.parent.mkdir(parents=True, exist_ok=True)
    source = repository.content_path(stored_file.sha256)
    return source.is_file() and copy_verified(source, target, stored_file.sha256, report_bytes)
