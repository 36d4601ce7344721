"""Partial results of an unfinished bake in object storage, from which other machines resume it.

parts/<bake>/<run>/…      files of the unfinished store; a task's files are there before its row is in the ledger
parts/<bake>/<run>.json   the tasks that are there
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Collection
from pathlib import Path

from relume.core.errors import StorageError
from relume.core.filesystem import UNFINISHED
from relume_worker.database.failures import DatabaseError
from relume_worker.storage.remote import get_storage

log = logging.getLogger(__name__)
TaskName = tuple[int, int]
"""Stage and index."""


class PartialUploads:
    """Partial results of one run of a bake in object storage; no effect without a storage.

    An outage of the storage delays nothing: missing files are uploaded with the next task.

    Args:
        staging: unfinished store. bake_id, run: bake and run marker of the store.
        tasks: finished and uploaded tasks.
    """

    def __init__(self, staging: Path, bake_id: str, run: str, tasks: Collection[TaskName]) -> None:
        self._staging, self._storage, self._name = staging, get_storage(), _name(bake_id, run)
        self._tasks, self._stored_files = set(tasks), dict[str, tuple[int, int]]()
        self._storage_error = DatabaseError(log, f"partial results of bake {bake_id} cannot be uploaded")

    def store(self, task: TaskName) -> None:
        """Upload the files that have appeared since the last call, including those of a finished task."""
        if self._storage is None:
            return
        self._tasks.add(task)
        changed = {
            name: state for name, state in _files(self._staging).items() if self._stored_files.get(name) != state
        }
        try:
            self._storage.put_files(self._name, self._staging, list(changed))
            self._storage.put_document(self._name, sorted(self._tasks))
        except StorageError as error:
            self._storage_error.report_failure(error)
            return
        self._storage_error.report_recovered()
        self._stored_files |= changed


def fetch_partial(staging: Path, bake_id: str, run: str, tasks: Collection[TaskName]) -> bool:
    """Replace the unfinished store by a run's partial results, if the storage has all these tasks; true if it has.

    Args:
        staging: unfinished store. bake_id, run: bake and run marker of the store.
        tasks: finished tasks in the ledger.
    Raises:
        StorageError: the storage does not answer.
    """
    storage = get_storage()
    if storage is None or not tasks:
        return False
    stored_tasks = storage.document(_name(bake_id, run))
    if not isinstance(stored_tasks, list) or not set(tasks) <= {
        tuple(entry) for entry in stored_tasks if isinstance(entry, list)
    }:
        return False
    shutil.rmtree(staging, ignore_errors=True)
    storage.fetch_files(_name(bake_id, run), staging)
    return True


def delete_partial(bake_id: str) -> None:
    """Delete the partial results of all runs of a bake. Raises StorageError."""
    if (storage := get_storage()) is not None:
        storage.delete(f"parts/{bake_id}")


def _name(bake_id: str, run: str) -> str:
    return f"parts/{bake_id}/{run}"


def _files(staging: Path) -> dict[str, tuple[int, int]]:
    """Complete files of an unfinished store, each with size and time."""
    files = {}
    for path in staging.rglob("*"):
        if path.suffix != ".partial" and not path.match(UNFINISHED) and path.is_file():
            stat = path.stat()
            files[path.relative_to(staging).as_posix()] = stat.st_size, stat.st_mtime_ns
    return files
