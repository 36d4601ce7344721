"""BTFs that are made or imported: rendered from a small geometry, or compressed from images that were sent."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from sqlalchemy.orm import Session, sessionmaker

from relume.folders import folder_bytes
from server.apart.btfs import FOUND, SENT
from server.apart.step import RunStep
from server.apart.step_timer import StepTimer
from server.queues.work import Quota, Work
from server.queues.work_queue import WorkQueue
from server.records.tables import BtfRow
from server.wire.btfs import BtfRequest
from worker.paths import btfs_path

BtfWork = Work[BtfRequest]


class BtfQueue(WorkQueue[BtfRequest]):
    """BTFs in the database, what is found so far in `data`/btf-works/<id>/; all of one is a step, done in turns."""

    row, noun, request_type = BtfRow, "BTF", BtfRequest
    resumable = ("stopped",)

    def __init__(
        self,
        sessions: sessionmaker[Session],
        data: Path,
        run: RunStep,
        quota: Quota,
        kept: Callable[[str, str, int], None],
        failed: Callable[[str], None],
    ) -> None:
        """
        Args:
            sessions: of the database. data: directory of what is made.
            run: does the steps. quota: how much may wait.
            kept: called with the id of a work that is done, that of the BTF, and how many bytes it takes.
            failed: called with the id of a work that has failed; nothing of it takes bytes any more.
        """
        super().__init__(sessions, data / "btf-works", run, quota)
        self._btfs, self._kept, self._failed = btfs_path(data), kept, failed

    def steps(self, request: BtfRequest) -> int:
        """One, which keeps what it has found when it is stopped."""
        return 1

    def step_s(self, request: BtfRequest) -> float | None:
        """Two of them have little in common."""
        return None

    def is_first(self, request: BtfRequest) -> bool:
        """Images are compressed in a tenth of the time that rendering them takes."""
        return request.geometry is None

    def material(self, identity: str) -> str | None:
        """Id of the BTF that a work has made; None where it is not ready."""
        path = self.folder / identity / FOUND
        return str(json.loads(path.read_text())["material"]) if path.exists() else None

    def step(self, work: BtfWork, timer: StepTimer) -> int:
        """Make it, or go on with it for a while."""
        folder = self.folder / work.id
        self.note(work.id, 0)
        values = {"request": work.request.model_dump(mode="json"), "folder": str(folder)}
        if not self.run_apart(work, "BTF", values, timer.tell)["is_done"]:
            return 0
        self.note(work.id, 0)  # the lease may be lost since
        if (material := self.material(work.id)) is not None:
            self._kept(work.id, material, folder_bytes(self._btfs / material))
        return 1

    def is_ready(self, work: BtfWork) -> None:
        """Let go what was sent: the material is there."""
        (self.folder / work.id / SENT).unlink(missing_ok=True)

    def has_failed(self, work: BtfWork) -> None:
        """Let go what was sent: nobody can go on with it."""
        shutil.rmtree(self.folder / work.id, ignore_errors=True)
        self._failed(work.id)
