"""Batch renders, frame by frame; finished frames are not rendered again after a restart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sqlalchemy.orm import Session, sessionmaker

from relume.core.folder_size import folder_bytes
from relume_server.batch.step import RunStep
from relume_server.batch.step_timer import StepTimer
from relume_server.io.downloads import safe_stem
from relume_server.jobs.job import Job, Quota
from relume_server.jobs.queue import JobQueue
from relume_server.persistence.tables import RenderRow
from relume_server.schemas.renders import RENDER_PLACEHOLDER, RenderRequest

RenderJob = Job[RenderRequest]
HEAD_BYTES = 1 << 16
"""Upper bound of an image file's size without pixels."""


class RenderQueue(JobQueue[RenderRequest]):
    """Batches in the database, with images in `data`/renders/<id>/; a step is one image."""

    row, noun, placeholder = RenderRow, "render", RENDER_PLACEHOLDER

    def __init__(
        self,
        sessions: sessionmaker[Session],
        data: Path,
        run: RunStep,
        quota: Quota,
        scene_name: Callable[[str], str],
        report_bytes: Callable[[str, int], object],
    ) -> None:
        """
        Args:
            sessions: sessions of the database. data: data directory.
            run: runs steps. quota: limits of the queue. scene_name: returns the name of the scene by a bake's id.
            report_bytes: called with the id of a finished render, and the size of its files in bytes.
        """
        super().__init__(sessions, data / "renders", run, quota)
        self._scene_name, self._report_bytes = scene_name, report_bytes

    def steps(self, request: RenderRequest) -> int:
        """One step per frame."""
        return request.num_frames

    def step_s(self, request: RenderRequest) -> float | None:
        """None: images of different batches have little in common."""
        return None

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

        self.requeue(job, ("ready", "failed"), remove_files)

    def step(self, job: RenderJob, timer: StepTimer) -> int:
        """Render the first missing image, or pack all."""
        missing = self.missing(job)
        done = job.total - len(missing)
        self.record_progress(job.id, min(done, job.total - 1))
        if missing:
            index = missing[0]
            values = {"request": job.request.model_dump(mode="json"), "index": index}
            values |= {"path": str(self.frame_path(job, index)), "scene_name": self._scene_name(job.request.bake)}
            self.run_in_process(job, "frame of a batch", values, timer.report)
            timer.next_step()
            return done + 1 if len(missing) > 1 else self._pack(job)
        return self._pack(job)

    def _pack(self, job: RenderJob) -> int:
        frames = [(str(self.frame_path(job, k)), self.download_name(job, k)) for k in range(job.total)]
        video = str(self.video_path(job)) if job.request.format == "mp4" else None
        values = {"frames": frames, "archive": str(self.archive_path(job)), "video": video, "fps": job.request.fps}
        self.run_in_process(job, "archive of a batch", values, lambda share: None)
        self.record_progress(job.id, job.total - 1)  # the lease may be lost by now
        self._report_bytes(job.id, folder_bytes(self.folder / job.id))
        return job.total


def planned_bytes(request: RenderRequest, size: tuple[int, int], num_layers: int) -> int:
    """Upper bound of the size of a render's files: uncompressed images, and all of them again in the archive.

    Args:
        request: the batch. size: size of an image, pixels. num_layers: per image, including the image itself.
    """
    channel_bytes = 1 if request.format != "exr" else 2 if request.precision == "half" else 4
    picture_bytes = size[0] * size[1] * 3 * channel_bytes * num_layers
    return 2 * request.num_frames * (picture_bytes + HEAD_BYTES)


def _stem(job: RenderJob) -> str:
    return safe_stem(job.request.name or job.request.view)
