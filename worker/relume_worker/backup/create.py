"""Create a backup while everything runs: the ledger first, then the files that it refers to, then all others.

Scenes and stores are on the disk before the ledger refers to them, and never change. If a file that the copied ledger
refers to is missing, it was deleted meanwhile; the backup then starts again, which is cheap since no file is copied
twice.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from time import gmtime, strftime

from sqlalchemy import Engine, select

from relume.store.schema import MANIFEST_NAME
from relume_worker.backup.contents import FileEntry, walk_files
from relume_worker.backup.database_dump import copy_ledger
from relume_worker.backup.repository import COPIES, BackupRepository, ReportBytes, Snapshot, StoredFile, compute_digest
from relume_worker.database.connect import connect
from relume_worker.database.models import JobRow, SceneRow
from relume_worker.database.upgrading import latest_revision
from relume_worker.storage import is_in_storage

ATTEMPTS = 3

StartReport = Callable[[int], ReportBytes]
"""Called with the total number of bytes; returns the progress callback."""


def create_backup(
    data_dir: Path,
    ledger: Engine,
    repository: BackupRepository,
    start_report: StartReport = lambda total: lambda done: None,
) -> Snapshot:
    """Add a snapshot to a backup folder. If it is interrupted, there is no snapshot, and the next backup reuses the
    copied files.

    Args:
        data_dir: data directory to back up. ledger: ledger of this directory.
        repository: the backup folder, created if missing.
        start_report: starts a progress report.
    Returns:
        The snapshot; `left_out` lists missing and damaged files.
    Raises:
        BackupError: the folder contains something else. DiskFullError: the disk is full.
    """
    with repository.lock():
        snapshot = _create_snapshot(data_dir, ledger, repository, start_report)
        repository.write(snapshot)
    return snapshot


def _create_snapshot(
    data_dir: Path, ledger: Engine, repository: BackupRepository, start_report: StartReport
) -> Snapshot:
    previous_files = _previous_files(repository)
    for attempt in range(ATTEMPTS):
        with tempfile.TemporaryDirectory(dir=repository.folder, prefix=COPIES) as folder:
            copy = Path(folder) / "ledger.db"
            copy_ledger(ledger, copy)
            required_paths, stored_ledger = _required_paths(copy), _store_ledger(copy, repository)
        files, problems = _store_files(data_dir, repository, previous_files, start_report)
        missing = {
            path
            for path in required_paths - {stored_file.path for stored_file in files}
            if not is_in_storage((data_dir / path).parent)
        }
        if not missing or attempt == ATTEMPTS - 1:
            break
        previous_files = {stored_file.path: stored_file for stored_file in files}
    problems += [f"{path} is missing in the data directory, although the database names it" for path in sorted(missing)]
    return Snapshot(
        _new_name(repository), version("relume"), latest_revision(), stored_ledger, tuple(files), tuple(problems)
    )


def _previous_files(repository: BackupRepository) -> dict[str, StoredFile]:
    """Files of the newest snapshot by path."""
    names = repository.names()
    return {stored_file.path: stored_file for stored_file in repository.read(names[-1]).files} if names else {}


def _required_paths(copy: Path) -> set[str]:
    """One file of every scene and finished bake in a ledger."""
    engine = connect(f"sqlite:///{copy}")
    with engine.connect() as connection:
        scenes = connection.scalars(select(SceneRow.id))
        paths = {f"scenes/{scene}/scene.json" for scene in scenes}
        ready_ids = connection.scalars(select(JobRow.id).where(JobRow.kind == "bake", JobRow.state == "ready"))
        paths |= {f"bakes/{bake}.zarr/{MANIFEST_NAME}" for bake in ready_ids}
    engine.dispose()
    return paths


def _store_ledger(copy: Path, repository: BackupRepository) -> StoredFile:
    sha256, stat = compute_digest(copy, lambda done: None), copy.stat()
    repository.store(copy, sha256, lambda done: None)
    return StoredFile("relume.db", stat.st_size, sha256, stat.st_mtime_ns)


def _store_files(
    data_dir: Path, repository: BackupRepository, previous_files: dict[str, StoredFile], start_report: StartReport
) -> tuple[list[StoredFile], list[str]]:
    """Store the files of the data directory; return the stored ones, and sentences on damaged ones."""
    entries = list(walk_files(data_dir))
    report_bytes = start_report(sum(file.num_bytes for file in entries))
    stored_files: list[StoredFile] = []
    damaged_keys: set[str] = set()
    for file in entries:
        try:
            stored_file = _store_file(data_dir, file, repository, previous_files.get(file.path), report_bytes)
        except FileNotFoundError:  # deleted in the meantime
            continue
        if stored_file is not None:
            stored_files.append(stored_file)
        else:
            damaged_keys.add("/".join(file.path.split("/")[:2]))
    intact = [stored_file for stored_file in stored_files if stored_file.content_key not in damaged_keys]
    return intact, [f"{name} is damaged; delete it, and bake or import it again" for name in sorted(damaged_keys)]


def _store_file(
    data_dir: Path,
    file: FileEntry,
    repository: BackupRepository,
    previous: StoredFile | None,
    report_bytes: ReportBytes,
) -> StoredFile | None:
    """Store a file; None if its content is not the expected one."""
    is_unchanged = previous is not None and (previous.num_bytes, previous.mtime_ns) == (file.num_bytes, file.mtime_ns)
    for _ in range(ATTEMPTS):
        sha256 = file.sha256 or (previous.sha256 if previous is not None and is_unchanged else None)
        if sha256 is None:
            sha256 = compute_digest(data_dir / file.path, lambda done: None)
        if repository.store(data_dir / file.path, sha256, report_bytes):
            return StoredFile(file.path, repository.content_path(sha256).stat().st_size, sha256, file.mtime_ns)
        if file.sha256 is not None:
            return None
        is_unchanged = False  # changed in the meantime
    return None


def _new_name(repository: BackupRepository) -> str:
    """Name of a snapshot: the time, with a number if there is one of this second."""
    time, existing_names = strftime("%Y%m%dT%H%M%SZ", gmtime()), repository.names()
    names: Sequence[str] = [time, *(f"{time}-{k}" for k in range(1, 100))]
    return next(name for name in names if name not in existing_names)
