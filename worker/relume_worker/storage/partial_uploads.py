"""What an unfinished bake has so far, in object storage: machines that take a bake over go on where another was.

parts/<bake>/<run>/…   files of the unfinished store, as they appear; a task's are there before the ledger knows of it
parts/<bake>/<run>.json   which tasks that are
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
    """Those of one run of a bake; nothing where there is no storage.

    A storage that is away delays nothing: what it lacks is stored with the next task.

    Args:
        staging: the unfinished store. bake_id, run: whose it is.
        tasks: that are finished and stored.
    """

    def __init__(self, staging: Path, bake_id: str, run: str, tasks: Collection[TaskName]) -> None:
        self._staging, self._storage, self._name = staging, get_storage(), _name(bake_id, run)
        self._tasks, self._stored_files = set(tasks), dict[str, tuple[int, int]]()
        self._storage_error = DatabaseError(log, f"parts of bake {bake_id} cannot be stored")

    def store(self, task: TaskName) -> None:
        """Store what has appeared since the last time, that of a finished task among it."""
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
    """Fetch the parts of a run in the place of what is there, where the storage has those of all these tasks.

    Args:
        staging: where the unfinished store lies. bake_id, run: whose it is. tasks: that the ledger calls finished.
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
    """Delete the parts of all runs of a bake. Raises StorageError."""
    if (storage := get_storage()) is not None:
        storage.delete(f"parts/{bake_id}")


def _name(bake_id: str, run: str) -> str:
    return f"parts/{bake_id}/{run}"


def _files(staging: Path) -> dict[str, tuple[int, int]]:
    """Whole files of an unfinished store, each with size and time."""
    files = {}
    for path in staging.rglob("*"):
        if path.suffix != ".partial" and not path.match(UNFINISHED) and path.is_file():
            stat = path.stat()
            files[path.relative_to(staging).as_posix()] = stat.st_size, stat.st_mtime_ns
    return files
