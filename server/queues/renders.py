"""Batch renders: one frame after another; what is on disk is not painted again after a restart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from sqlalchemy.orm import Session, sessionmaker

from relume.folders import folder_bytes
from server.apart.step import RunStep
from server.apart.step_timer import StepTimer
from server.files.downloads import safe_stem
from server.queues.work import Quota, Work
from server.queues.work_queue import WorkQueue
from server.records.tables import RenderRow
from server.wire.renders import RenderRequest

Render = Work[RenderRequest]
HEAD_BYTES = 1 << 16
"""More than a picture's file has besides its pixels."""


class RenderQueue(WorkQueue[RenderRequest]):
    """Batches in the database, pictures in `data`/renders/<id>/; a step is a picture."""

    row, noun, request_type = RenderRow, "render", RenderRequest

    def __init__(
        self,
        sessions: sessionmaker[Session],
        data: Path,
        run: RunStep,
        quota: Quota,
        scene_name: Callable[[str], str],
        measured: Callable[[str, int], object],
    ) -> None:
        """
        Args:
            sessions: of the database. data: directory of bakes and pictures.
            run: does the steps. quota: how much may wait. scene_name: of a bake's id.
            measured: told the id of a finished render, and what its files take, bytes.
        """
        super().__init__(sessions, data / "renders", run, quota)
        self._scene_name, self._measured = scene_name, measured

    def steps(self, request: RenderRequest) -> int:
        """One for each frame."""
        return request.num_frames

    def step_s(self, request: RenderRequest) -> float | None:
        """Pictures of two batches have little in common."""
        return None

    def frame_path(self, render: Render, index: int) -> Path:
        """File of one picture, there or not."""
        return self.folder / render.id / f"{index:04d}.{render.request.picture_format}"

    def download_name(self, render: Render, index: int) -> str:
        """What the file of one picture is called where it is saved."""
        number = f"-{index:04d}" if render.total > 1 else ""
        return f"{_stem(render)}{number}.{render.request.picture_format}"

    def archive_name(self, render: Render) -> str:
        """What the file of all pictures is called where it is saved."""
        return f"{_stem(render)}.zip"

    def video_name(self, render: Render) -> str:
        """What the video is called where it is saved."""
        return f"{_stem(render)}.mp4"

    def video_path(self, render: Render) -> Path:
        """The finished batch as a video, where one was asked for."""
        return self.folder / render.id / "video.mp4"

    def archive_path(self, render: Render) -> Path:
        """The finished batch in one file."""
        return self.folder / render.id / "archive.zip"

    def is_first(self, request: RenderRequest) -> bool:
        """A single picture does not wait behind animations."""
        return request.num_frames == 1

    def missing(self, render: Render) -> list[int]:
        """Which pictures are not painted yet."""
        return [index for index in range(render.total) if not self.frame_path(render, index).exists()]

    def retry(self, render: Render, index: int) -> None:
        """Paint one picture again, and pack all anew.

        Raises:
            NotReadyError: the batch waits or runs. BusyError, QuotaError: as `submit`.
        """

        def forget() -> None:
            for path in (self.frame_path(render, index), self.archive_path(render), self.video_path(render)):
                path.unlink(missing_ok=True)

        self.requeue(render, ("ready", "failed"), forget)

    def step(self, work: Render, timer: StepTimer) -> int:
        """Paint the first picture that is missing, or pack them."""
        missing = self.missing(work)
        done = work.total - len(missing)
        self.note(work.id, min(done, work.total - 1))
        if missing:
            index = missing[0]
            values = {"request": work.request.model_dump(mode="json"), "index": index}
            values |= {"path": str(self.frame_path(work, index)), "scene_name": self._scene_name(work.request.bake)}
            self.run_apart(work, "frame of a batch", values, timer.tell)
            timer.next_step()
            return done + 1 if len(missing) > 1 else self._packed(work)
        return self._packed(work)

    def _packed(self, work: Render) -> int:
        frames = [(str(self.frame_path(work, k)), self.download_name(work, k)) for k in range(work.total)]
        video = str(self.video_path(work)) if work.request.format == "mp4" else None
        values = {"frames": frames, "archive": str(self.archive_path(work)), "video": video, "fps": work.request.fps}
        self.run_apart(work, "pack of a batch", values, lambda share: None)
        self.note(work.id, work.total - 1)  # the lease may be lost since
        self._measured(work.id, folder_bytes(self.folder / work.id))
        return work.total


def planned_bytes(request: RenderRequest, size: tuple[int, int], num_layers: int) -> int:
    """What the files of a render take at most: its pictures uncompressed, and all of them again, packed.

    Args:
        request: what is asked for. size: of a picture, pixels. num_layers: of a picture, itself among them.
    """
    channel_bytes = 1 if request.format != "exr" else 2 if request.precision == "half" else 4
    picture_bytes = size[0] * size[1] * 3 * channel_bytes * num_layers
    return 2 * request.num_frames * (picture_bytes + HEAD_BYTES)


def _stem(render: Render) -> str:
    return safe_stem(render.request.name or render.request.view)
