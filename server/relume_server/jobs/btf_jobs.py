"""BTF jobs: render a BTF from a small geometry, or compress one from uploaded images."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from sqlalchemy.orm import Session, sessionmaker

from relume.core.folder_size import folder_bytes
from relume_server.batch.btf_steps import RESULT_FILE, UPLOAD_FILE
from relume_server.batch.step import RunStep
from relume_server.batch.step_timer import StepTimer
from relume_server.jobs.job import Job, Quota
from relume_server.jobs.queue import JobQueue
from relume_server.persistence.tables import BtfRow
from relume_server.schemas.btfs import BOUND, BtfRequest
from relume_worker.paths import btfs_path

BtfJob = Job[BtfRequest]


class BtfQueue(JobQueue[BtfRequest]):
    """BTF jobs in the database, with files in `data`/btf-jobs/<id>/; one step per job, which can be interrupted."""

    row, noun, placeholder = BtfRow, "BTF", BtfRequest(name="unknown", error=BOUND)
    resumable = ("stopped",)

    def __init__(
        self,
        sessions: sessionmaker[Session],
        data: Path,
        run: RunStep,
        quota: Quota,
        report_ready: Callable[[str, str, int], None],
        report_failed: Callable[[str], None],
    ) -> None:
        """
        Args:
            sessions: sessions of the database. data: data directory.
            run: runs steps. quota: limits of the queue.
            report_ready: called with the ids of a finished job and of its BTF, and its size in bytes.
            report_failed: called with the id of a failed job; it takes no more space.
        """
        super().__init__(sessions, data / "btf-jobs", run, quota)
        self._btfs, self._report_ready, self._report_failed = btfs_path(data), report_ready, report_failed

    def steps(self, request: BtfRequest) -> int:
        """One step, which saves partial results when it is interrupted."""
        return 1

    def step_s(self, request: BtfRequest) -> float | None:
        """None: BTFs have little in common."""
        return None

    def is_first(self, request: BtfRequest) -> bool:
        """Compression first: it takes a tenth of the time of rendering."""
        return request.geometry is None

    def material(self, identity: str) -> str | None:
        """Id of the BTF that a job has made; None if it is not ready, or if its file is damaged."""
        with suppress(FileNotFoundError, ValueError, LookupError, TypeError):
            return str(json.loads((self.folder / identity / RESULT_FILE).read_bytes())["material"])
        return None

    def step(self, job: BtfJob, timer: StepTimer) -> int:
        """Start or resume the job, for a while."""
        folder = self.folder / job.id
        self.record_progress(job.id, 0)
        values = {"request": job.request.model_dump(mode="json"), "folder": str(folder)}
        if not self.run_in_process(job, "BTF", values, timer.report)["is_done"]:
            return 0
        self.record_progress(job.id, 0)  # the lease may be lost by now
        if (material := self.material(job.id)) is not None:
            self._report_ready(job.id, material, folder_bytes(self._btfs / material))
        return 1

    def on_ready(self, job: BtfJob) -> None:
        """Delete the uploads: the BTF is stored."""
        (self.folder / job.id / UPLOAD_FILE).unlink(missing_ok=True)

    def on_failed(self, job: BtfJob) -> None:
        """Delete the uploads: the job cannot be resumed."""
        shutil.rmtree(self.folder / job.id, ignore_errors=True)
        self._report_failed(job.id)
