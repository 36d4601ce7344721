"""Batch renders: one frame after another; what is on disk is not painted again after a restart."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy.orm import Session, sessionmaker

from relume.exr.attributes import Origin, attributes_of
from relume.exr.layers import layers_of
from relume.exr.picture import Progress, export_exr
from relume.imageio.files import write_image
from relume.imageio.shrink import shrink
from relume.picture.transfer import Axis, Opened
from relume.replacing import replacing
from server.files.downloads import safe_stem
from server.files.video import write_video
from server.library.ports import F32, Library
from server.queues.animation import eyes_of, look_of
from server.queues.step_timer import StepTimer
from server.queues.work_queue import Work, WorkQueue
from server.records.tables import RenderRow
from server.wire.renders import RenderRequest

if TYPE_CHECKING:
    from relume.scene.model import Camera

Render = Work[RenderRequest]


class RenderQueue(WorkQueue[RenderRequest]):
    """Batches in the database, pictures in `data`/renders/<id>/; a step is a picture."""

    row, noun, request_type = RenderRow, "render", RenderRequest

    def __init__(
        self, sessions: sessionmaker[Session], data: Path, library: Library, scene_name: Callable[[str], str]
    ) -> None:
        """
        Args:
            sessions: of the database. data: directory of bakes and pictures.
            library: paints. scene_name: of a scene's id.
        """
        super().__init__(sessions, data / "renders")
        self._data, self._library, self._scene_name = data, library, scene_name

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

    def work(self, work: Render, timer: StepTimer) -> None:
        """Paint all pictures of one batch, and pack them."""
        for stray in (self.folder / work.id).glob(".layers-*"):  # a killed server left them
            shutil.rmtree(stray, ignore_errors=True)
        transfer = self._library.open_in_passing(self._data / "bakes" / f"{work.request.bake}.zarr")
        for index, camera in enumerate(eyes_of(work.request, transfer)):
            self.note(work.id, index)
            self._paint_frame(transfer, work, index, camera, timer.tell)
            timer.next_step()
        if work.request.format == "mp4":
            target, fps = self.video_path(work), work.request.fps
            write_video(target.parent, fps, target, lambda: not self.is_wanted(work.id))
        self._pack(work)

    def _paint_frame(self, transfer: Opened, work: Render, index: int, camera: Camera | None, tell: Progress) -> None:
        path, request = self.frame_path(work, index), work.request
        if path.exists():
            return
        view = transfer.views[request.view]
        eye = None if camera is None else (camera, request.size or (view.width, view.height))

        def render(look: Any, progress: Progress) -> F32:
            image = self._library.render(
                transfer, request.view, look, progress=progress, for_display=request.format != "exr",
                cancelled=lambda: not self.is_wanted(work.id), eye=eye, exact=request.exact,
            )  # fmt: skip
            return image if request.size is None or eye is not None else shrink(image, request.size)

        look = look_of(request, transfer.default_look, index)
        if request.format == "exr":
            self._export(path, render, look, transfer, request, camera or view.camera, tell)
        else:
            write_image(path, render(look, tell), look.display.exposure, look.display.tone_map)

    def _export(
        self,
        path: Path,
        render: Any,
        look: Any,
        transfer: Opened,
        request: RenderRequest,
        camera: Camera,
        progress: Progress,
    ) -> None:
        view = transfer.views[request.view]
        layers = layers_of(look, reflects=Axis.BOUNCES in transfer.axes) if request.layers else []
        origin = Origin(transfer.scene_id, self._scene_name(transfer.scene_id), request.bake)
        size = request.size or (view.width, view.height)
        attributes = attributes_of(origin, camera, size, look, layers)
        export_exr(path, render, look, layers, attributes, request.precision, progress)

    def _pack(self, render: Render) -> None:
        with replacing(self.archive_path(render)) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            for index in range(render.total):
                archive.write(self.frame_path(render, index), self.download_name(render, index))


def _stem(render: Render) -> str:
    return safe_stem(render.request.name or render.request.view)
