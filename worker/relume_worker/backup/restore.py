"""Restore a backup into an empty data directory and an empty ledger.

A marker file is in the directory until the restore is complete, and no relume process uses a directory with it; the
same restore resumes there.
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
    """Raise BackupError if a restore into a data directory is incomplete."""
    if (data_dir / MARK).exists():
        raise BackupError(
            f"a restore into {data_dir} was not finished; run relume restore again, which resumes, or empty the folder"
        )


def restore(
    repository: BackupRepository,
    name: str | None,
    data_dir: Path,
    ledger_url: str,
    start_report: StartReport = lambda total: lambda done: None,
) -> tuple[Snapshot, Sequence[str]]:
    """Restore a snapshot, verifying every file. An object with damaged files is skipped, so that one bake does not cost
    all others; the bake's row in the ledger remains, so that it is baked again.

    Args:
        repository: the backup folder. name: name of the snapshot; None: the newest.
        data_dir: empty, missing, or with the same restore interrupted. ledger_url: URL of an empty ledger.
        start_report: starts a progress report.
    Returns:
        The snapshot, and one sentence for each object that is damaged in the backup.
    Raises:
        BackupError: there is no such backup, its ledger is damaged, or the destination is not empty.
        DiskFullError: the disk is full.
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
            raise BackupError("the database is damaged in the backup; empty the folder, and restore an older backup")
        target = open_database(ledger_url)
        try:
            if is_empty(target):  # otherwise the restore was killed after this step, which is atomic
                fill_ledger(copy, target)
        finally:
            target.dispose()
    for leftover in data_dir.rglob(UNFINISHED):  # of killed restores
        leftover.unlink(missing_ok=True)
    (data_dir / MARK).unlink()
    return snapshot, [
        f"{content_key} is damaged in the backup: bake or import it again" for content_key in sorted(damaged)
    ]


def _mark(repository: BackupRepository, snapshot: Snapshot, data_dir: Path, ledger_url: str) -> None:
    """Write the marker; refuse a directory with other contents."""
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    mark, document = data_dir / MARK, {"from": str(repository.folder.resolve()), "snapshot": snapshot.name}
    if mark.exists():
        existing = json.loads(mark.read_text(encoding="utf-8"))
        if existing != document:
            raise BackupError(
                f"the restore of {existing['snapshot']} into {data_dir} was not finished; resume that one"
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
            raise BackupError("the database is not empty; restore into an empty one (RELUME_DATABASE)")
    finally:
        engine.dispose()


def _delete(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def _restore_file(
    repository: BackupRepository, stored_file: StoredFile, target: Path, report_bytes: ReportBytes
) -> bool:
    """Restore a file; true if it now exists with the expected content."""
    if target.exists() and target.stat().st_size == stored_file.num_bytes:  # complete, from before an interruption
        report_bytes(stored_file.num_bytes)
        return True
    target.parent.mkdir(parents=True, exist_ok=True)
    source = repository.content_path(stored_file.sha256)
    return source.is_file() and copy_verified(source, target, stored_file.sha256, report_bytes)
