"""What an unfinished bake has so far, in object storage: machines that take a bake over go on where another was.

parts/<bake>/<run>/…   files of the unfinished store, as they appear; a task's are there before the ledger knows of it
parts/<bake>/<run>.json   which tasks that are
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Collection
from pathlib import Path

from relume.errors import StorageError
from relume.replacing import UNFINISHED
from worker.database.faults import Complaint
from worker.storage.remote import configured

log = logging.getLogger(__name__)
TaskName = tuple[int, int]
"""Stage and index."""


class Parts:
    """Those of one run of a bake; nothing where there is no storage.

    A storage that is away delays nothing: what it lacks is stored with the next task.

    Args:
        staging: the unfinished store. bake_id, run: whose it is.
        tasks: that are finished and stored.
    """

    def __init__(self, staging: Path, bake_id: str, run: str, tasks: Collection[TaskName]) -> None:
        self._staging, self._there, self._name = staging, configured(), _name(bake_id, run)
        self._tasks, self._stored = set(tasks), dict[str, tuple[int, int]]()
        self._complaint = Complaint(log, f"parts of bake {bake_id} cannot be stored", asks_database=False)

    def store(self, task: TaskName) -> None:
        """Store what has appeared since the last time, that of a finished task among it."""
        if self._there is None:
            return
        self._tasks.add(task)
        found = {name: state for name, state in _files(self._staging).items() if self._stored.get(name) != state}
        try:
            self._there.put_files(self._name, self._staging, list(found))
            self._there.put_document(self._name, sorted(self._tasks))
        except StorageError as error:
            self._complaint.meet(error)
            return
        self._complaint.well()
        self._stored |= found


def fetch_parts(staging: Path, bake_id: str, run: str, tasks: Collection[TaskName]) -> bool:
    """Fetch the parts of a run in the place of what is there, where the storage has those of all these tasks.

    Args:
        staging: where the unfinished store lies. bake_id, run: whose it is. tasks: that the ledger calls finished.
    Raises:
        StorageError: the storage does not answer.
    """
    there = configured()
    if there is None or not tasks:
        return False
    stored = there.document(_name(bake_id, run))
    if not isinstance(stored, list) or not set(tasks) <= {tuple(each) for each in stored if isinstance(each, list)}:
        return False
    shutil.rmtree(staging, ignore_errors=True)
    there.fetch_files(_name(bake_id, run), staging)
    return True


def forget_parts(bake_id: str) -> None:
    """Delete the parts of all runs of a bake. Raises StorageError."""
    if (there := configured()) is not None:
        there.delete(f"parts/{bake_id}")


def _name(bake_id: str, run: str) -> str:
    return f"parts/{bake_id}/{run}"


def _files(staging: Path) -> dict[str, tuple[int, int]]:
    """Whole files of an unfinished store, each with size and time."""
    found = {}
    for path in staging.rglob("*"):
        if path.suffix != ".partial" and not path.match(UNFINISHED) and path.is_file():
            told = path.stat()
            found[path.relative_to(staging).as_posix()] = told.st_size, told.st_mtime_ns
    return found
