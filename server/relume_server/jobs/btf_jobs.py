"""BTF jobs: render a BTF from a small geometry, or compress one from uploaded images."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from relume.core.folder_size import folder_bytes
from relume_server.batch.btf_steps import RESULT_FILE, UPLOAD_FILE
from relume_server.schemas.btfs import BOUND, BtfRequest
from relume_worker.jobs.job import Job
from relume_worker.jobs.job_kind import JobKind
from relume_worker.jobs.job_run import JobRun
from relume_worker.jobs.job_service import JobService
from relume_worker.paths import btfs_path

BtfJob = Job[BtfRequest]


class BtfJobs(JobKind[BtfRequest]):
    """BTF jobs with files in `data`/btf-jobs/<id>/; one step per job, in slices of time."""

    name, placeholder = "btf", BtfRequest(name="unknown", error=BOUND)
    resumable = ("canceled",)

    def __init__(
        self,
        service: JobService,
        data: Path,
        report_ready: Callable[[str, str, int], None],
        report_failed: Callable[[str], None],
    ) -> None:
        """
        Args:
            service: runs the jobs. data: data directory.
            report_ready: called with the ids of a finished job and of its BTF, and its size in bytes.
            report_failed: called with the id of a failed job; it takes no more space.
        """
        super().__init__(service, data / "btf-jobs")
        self._btfs, self._report_ready, self._report_failed = btfs_path(data), report_ready, report_failed

    def steps(self, request: BtfRequest) -> int:
        """One step, which saves partial results when it is interrupted."""
        return 1

    def is_first(self, request: BtfRequest) -> bool:
        """Compression first: it takes a tenth of the time of rendering."""
        return request.geometry is None

    def material(self, identity: str) -> str | None:
        """Id of the BTF that a job has made; None if it is not ready, or if its file is damaged."""
        with suppress(FileNotFoundError, ValueError, LookupError, TypeError):
            return str(json.loads((self.folder / identity / RESULT_FILE).read_bytes())["material"])
        return None

    def run(self, run: JobRun[BtfRequest]) -> None:
        """Start or resume the job; after each slice of time others may have a turn."""
        job = run.job
        values = {"request": job.request.model_dump(mode="json"), "folder": str(run.folder)}
        is_done = False
        run.timer.start()
        while not is_done:
            run.record(0)
            answer = run.step("BTF", values, lambda fraction: run.timer.report(0, fraction))
            is_done = bool(answer["is_done"])
        run.record(0)  # the lease may be lost by now
        if (material := self.material(job.id)) is not None:
            self._report_ready(job.id, material, folder_bytes(self._btfs / material))

    def on_ready(self, identity: str) -> None:
        """Delete the uploads: the BTF is stored."""
        (self.folder / identity / UPLOAD_FILE).unlink(missing_ok=True)

    def on_failed(self, identity: str) -> None:
        """Delete the uploads: the job cannot be resumed."""
        shutil.rmtree(self.folder / identity, ignore_errors=True)
        self._report_failed(identity)
