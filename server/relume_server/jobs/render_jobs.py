"""Batch renders, frame by frame; finished frames are not rendered again after a restart."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from relume.core.errors import NotFoundError
from relume.core.filesystem import UNFINISHED
from relume.core.folder_size import folder_bytes
from relume.output.contact_sheet import CELL_BYTES
from relume.output.file_names import safe_stem
from relume_server.schemas.renders import RENDER_PLACEHOLDER, QueuedRender, RenderRequest
from relume_worker.jobs.job import Job, NotReadyError
from relume_worker.jobs.job_kind import JobKind
from relume_worker.jobs.job_run import JobRun
from relume_worker.jobs.job_service import JobService
from relume_worker.status import BakeStatus

_AOV_BYTES = 4 * 39  # of a pixel: 32-bit floats

RenderJob = Job[QueuedRender]
BAKE_POLL_S = 0.5
HEAD_BYTES = 1 << 16
"""Upper bound of an image file's size without pixels."""
LAYER_FOLDERS = ".layers-*"
"""Folders of `relume.output.exr.export`, next to an image that is being written."""


class RenderJobs(JobKind[QueuedRender]):
    """Batches of images in `data`/renders/<id>/; a step is one image, and as many run at once as there are slots."""

    name, placeholder = "render", RENDER_PLACEHOLDER

    def __init__(
        self,
        service: JobService,
        data: Path,
        scene_name: Callable[[str], str],
        find_bake: Callable[[str], BakeStatus],
        report_bytes: Callable[[str, int], object],
        notify: Callable[[RenderJob], object] = lambda job: None,
    ) -> None:
        """
        Args:
            service: runs the jobs. data: data directory. scene_name: of a bake's id.
            find_bake: state of a bake by its id.
            report_bytes: called with the id of a finished render, and the size of its files in bytes.
            notify: called when a render is ready or has failed.
        """
        super().__init__(service, data / "renders")
        self._scene_name, self._find_bake = scene_name, find_bake
        self._report_bytes, self._notify = report_bytes, notify

    def steps(self, request: QueuedRender) -> int:
        """One step per image."""
        return request.num_images

    def priority(self, request: QueuedRender) -> int:
        """As requested."""
        return request.priority

    def on_ready(self, identity: str) -> None:
        """Notify, unless it was deleted meanwhile."""
        with suppress(NotFoundError):
            self._notify(self.get(identity))

    def on_failed(self, identity: str) -> None:
        """Notify, unless it was deleted meanwhile."""
        self.on_ready(identity)

    def frame_path(self, job: RenderJob, index: int) -> Path:
        """File of one image, existing or not."""
        return self.folder / job.id / f"{index:04d}.{job.request.picture_format}"

    def download_name(self, job: RenderJob, index: int) -> str:
        """Download name of one image."""
        names = job.request.file_names
        return names[index] if names else f"{index:04d}.{job.request.picture_format}"

    def archive_name(self, job: RenderJob) -> str:
        """Download name of the archive."""
        return f"{_stem(job)}.zip"

    def video_name(self, job: RenderJob) -> str:
        """Download name of the video."""
        return f"{_stem(job)}.mp4"

    def video_path(self, job: RenderJob) -> Path:
        """File of the video."""
        return self.folder / job.id / "video.mp4"

    def sheet_name(self, job: RenderJob) -> str:
        """Download name of the contact sheet."""
        return f"{_stem(job)}.png"

    def sheet_path(self, job: RenderJob) -> Path:
        """File of the contact sheet."""
        return self.folder / job.id / "contact-sheet.png"

    def archive_path(self, job: RenderJob) -> Path:
        """File of the archive."""
        return self.folder / job.id / "archive.zip"

    def is_first(self, request: QueuedRender) -> bool:
        """True for single images, which do not wait for animations."""
        return request.num_images == 1

    def missing(self, job: RenderJob) -> list[int]:
        """Indices of the missing images."""
        return [index for index in range(job.total) if not self.frame_path(job, index).exists()]

    def retry(self, job: RenderJob, index: int) -> None:
        """Render one image again, and pack all images again.

        Raises:
            NotReadyError: the batch is queued or running. BusyError, QuotaError: as `submit`.
        """

        def remove_files() -> None:
            packed = self.archive_path(job), self.video_path(job), self.sheet_path(job)
            for path in (self.frame_path(job, index), *packed):
                path.unlink(missing_ok=True)

        self.requeue(job.id, ("ready", "failed"), remove_files)

    def run(self, run: JobRun[QueuedRender]) -> None:
        """Render the missing images when their bakes are ready, and pack all."""
        job, missing = run.job, self.missing(run.job)
        done = job.total - len(missing)
        run.record(done)
        for bake in dict.fromkeys(bake for bake, _ in job.request.bake_views):
            self._wait_for_bake(run, bake, done)
        _remove_unfinished(run.folder)
        views = {each: self._view_values(job.request, *each) for each in set(job.request.bake_views)}
        frames = {}
        for k in missing:
            bake, view, frame = job.request.image(k)
            frames[k] = {**views[bake, view], "index": frame, "path": str(self.frame_path(job, k))}
        run.timed_steps("frame of a batch", frames, done)
        self._pack(run)

    def _wait_for_bake(self, run: JobRun[QueuedRender], bake: str, done: int) -> None:
        """Wait until a bake is ready. Raises NotReadyError if it failed or was canceled."""
        while (status := self._find_bake(bake)).state != "ready":
            if status.final:
                reason = f": {status.problem}" if status.problem else ""
                raise NotReadyError(f"the bake of these images is {status.state}{reason}; resume the render")
            time.sleep(BAKE_POLL_S)
            run.record(done)

    def _view_values(self, request: QueuedRender, bake: str, view: str) -> dict[str, Any]:
        """Arguments of the steps of a view, whose request is of this view alone."""
        single = {
            "bake": bake,
            "view": view,
            "views": [],
            "look_views": [],
            "file_names": [],
            "labels": [],
            "warnings": [],
        }
        document = request.model_copy(update=single).model_dump(mode="json")
        return {"request": document, "scene_name": self._scene_name(bake)}

    def _pack(self, run: JobRun[QueuedRender]) -> None:
        job = run.job
        frames = [(str(self.frame_path(job, k)), self.download_name(job, k)) for k in range(job.total)]
        video = str(self.video_path(job)) if job.request.format == "mp4" else None
        is_sheet = job.request.format == "contact_sheet"
        name = f"contact-sheet-{self.sheet_name(job)}"
        sheet = {"path": str(self.sheet_path(job)), "name": name, "labels": job.request.labels} if is_sheet else None
        archive = str(self.archive_path(job))
        values = {"frames": frames, "archive": archive, "video": video, "fps": job.request.fps, "sheet": sheet}
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
    """Upper bound of the size of a view's files: uncompressed images, and all of them again in archive or video.

    Args:
        request: the batch. size: size of an image, pixels. num_layers: per image, including the image itself.
    """
    channel_bytes = 1 if request.format != "exr" else 2 if request.precision == "half" else 4
    aov_bytes = _AOV_BYTES * request.aovs
    picture_bytes = size[0] * size[1] * (3 * channel_bytes * num_layers + aov_bytes)
    sheet_bytes = CELL_BYTES * (request.format == "contact_sheet")
    return len(request.frame_indices) * (2 * (picture_bytes + HEAD_BYTES) + sheet_bytes)


def ended_message(job: RenderJob) -> bytes:
    """Body of the webhook of a render that is ready or has failed, JSON."""
    fields = {"render": job.id, "name": job.request.name, "state": job.state, "problem": job.problem}
    counts = {"completed": job.completed, "total": job.total, "url": f"/api/renders/{job.id}"}
    return json.dumps({"event": "render.ended", **fields, **counts}).encode()


def _stem(job: RenderJob) -> str:
    return safe_stem(job.request.name or job.request.view or "render")
