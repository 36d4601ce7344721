"""Batch renders, frame by frame; finished frames are not rendered again after a restart."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from relume.core.filesystem import UNFINISHED
from relume.core.folder_size import folder_bytes
from relume_server.io.downloads import safe_stem
from relume_server.schemas.renders import RENDER_PLACEHOLDER, RenderRequest
from relume_worker.jobs.job import Job
from relume_worker.jobs.job_kind import JobKind
from relume_worker.jobs.job_run import JobRun
from relume_worker.jobs.job_service import JobService

_AOV_BYTES = 4 * 39  # of a pixel: 32-bit floats

RenderJob = Job[RenderRequest]
HEAD_BYTES = 1 << 16
"""Upper bound of an image file's size without pixels."""
LAYER_FOLDERS = ".layers-*"
"""Folders of `relume.output.exr.export`, next to an image that is being written."""


class RenderJobs(JobKind[RenderRequest]):
    """Batches of images in `data`/renders/<id>/; a step is one image, and as many run at once as there are slots."""

    name, placeholder = "render", RENDER_PLACEHOLDER

    def __init__(
        self,
        service: JobService,
        data: Path,
        scene_name: Callable[[str], str],
        report_bytes: Callable[[str, int], object],
    ) -> None:
        """
        Args:
            service: runs the jobs. data: data directory. scene_name: of a bake's id.
            report_bytes: called with the id of a finished render, and the size of its files in bytes.
        """
        super().__init__(service, data / "renders")
        self._scene_name, self._report_bytes = scene_name, report_bytes

    def steps(self, request: RenderRequest) -> int:
        """One step per frame."""
        return request.num_frames

    def frame_path(self, job: RenderJob, index: int) -> Path:
        """File of one image, existing or not."""
        return self.folder / job.id / f"{index:04d}.{job.request.picture_format}"

    def download_name(self, job: RenderJob, index: int) -> str:
        """Download name of one image."""
        number = f"-{index:04d}" if job.total > 1 else ""
        return f"{_stem(job)}{number}.{job.request.picture_format}"

    def archive_name(self, job: RenderJob) -> str:
        """Download name of the archive."""
        return f"{_stem(job)}.zip"

    def video_name(self, job: RenderJob) -> str:
        """Download name of the video."""
        return f"{_stem(job)}.mp4"

    def video_path(self, job: RenderJob) -> Path:
        """File of the video."""
        return self.folder / job.id / "video.mp4"

    def archive_path(self, job: RenderJob) -> Path:
        """File of the archive."""
        return self.folder / job.id / "archive.zip"

    def is_first(self, request: RenderRequest) -> bool:
        """True for single images, which do not wait for animations."""
        return request.num_frames == 1

    def missing(self, job: RenderJob) -> list[int]:
        """Indices of the missing images."""
        return [index for index in range(job.total) if not self.frame_path(job, index).exists()]

    def retry(self, job: RenderJob, index: int) -> None:
        """Render one image again, and pack all images again.

        Raises:
            NotReadyError: the batch is queued or running. BusyError, QuotaError: as `submit`.
        """

        def remove_files() -> None:
            for path in (self.frame_path(job, index), self.archive_path(job), self.video_path(job)):
                path.unlink(missing_ok=True)

        self.requeue(job.id, ("ready", "failed"), remove_files)

    def run(self, run: JobRun[RenderRequest]) -> None:
        """Render the missing images, and pack all."""
        job, missing = run.job, self.missing(run.job)
        done = job.total - len(missing)
        run.record(done)
        _remove_unfinished(run.folder)
        values = {"request": job.request.model_dump(mode="json"), "scene_name": self._scene_name(job.request.bake)}
        frames = {k: {**values, "index": k, "path": str(self.frame_path(job, k))} for k in missing}
        run.timed_steps("frame of a batch", frames, done)
        self._pack(run)

    def _pack(self, run: JobRun[RenderRequest]) -> None:
        job = run.job
        frames = [(str(self.frame_path(job, k)), self.download_name(job, k)) for k in range(job.total)]
        video = str(self.video_path(job)) if job.request.format == "mp4" else None
        values = {"frames": frames, "archive": str(self.archive_path(job)), "video": video, "fps": job.request.fps}
        run.step("archive of a batch", values, num_bytes=folder_bytes(run.folder))
        run.record(job.total)  # the lease may be lost by now
        self._report_bytes(job.id, folder_bytes(run.folder))


def _remove_unfinished(folder: Path) -> None:
    """Remove files of killed processes from the folder of a batch, none of whose images is being rendered."""
    for stray in folder.glob(LAYER_FOLDERS):
        shutil.rmtree(stray, ignore_errors=True)
    for unfinished in folder.glob(UNFINISHED):
        unfinished.unlink(missing_ok=True)


def planned_bytes(request: RenderRequest, size: tuple[int, int], num_layers: int) -> int:
    """Upper bound of the size of a render's files: uncompressed images, and all of them again in the archive.

    Args:
        request: the batch. size: size of an image, pixels. num_layers: per image, including the image itself.
    """
    channel_bytes = 1 if request.format != "exr" else 2 if request.precision == "half" else 4
    aov_bytes = _AOV_BYTES * request.aovs
    picture_bytes = size[0] * size[1] * (3 * channel_bytes * num_layers + aov_bytes)
    return 2 * request.num_frames * (picture_bytes + HEAD_BYTES)


def _stem(job: RenderJob) -> str:
    return safe_stem(job.request.name or job.request.view)
