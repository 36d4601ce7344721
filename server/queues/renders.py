"""Batch renders: one look after another; what is on disk is not painted again after a restart."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session, sessionmaker

from relume import look as looks
from relume.exr.attributes import Origin, attributes_of
from relume.exr.layers import layers_of
from relume.exr.picture import Progress, export_exr
from relume.imageio import write_image
from relume.imageio.shrink import shrink
from relume.picture.transfer import Axis, Opened
from relume.replacing import replacing
from server.files.downloads import safe_stem
from server.library.ports import F32, Library
from server.queues.step_timer import StepTimer
from server.queues.work_queue import Work, WorkQueue
from server.records.tables import RenderRow
from server.wire.bodies import RenderRequest

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
        """One for each look."""
        return len(request.looks)

    def step_s(self, request: RenderRequest) -> float | None:
        """Pictures of two batches have little in common."""
        return None

    def frame_path(self, render: Render, index: int) -> Path:
        """File of one picture, there or not."""
        return self.folder / render.id / f"{index:04d}.{render.request.format}"

    def download_name(self, render: Render, index: int) -> str:
        """What the file of one picture is called where it is saved."""
        number = f"-{index:04d}" if render.total > 1 else ""
        return f"{_stem(render)}{number}.{render.request.format}"

    def archive_name(self, render: Render) -> str:
        """What the file of all pictures is called where it is saved."""
        return f"{_stem(render)}.zip"

    def archive_path(self, render: Render) -> Path:
        """The finished batch in one file."""
        return self.folder / render.id / "archive.zip"

    def work(self, work: Render, timer: StepTimer) -> None:
        """Paint all pictures of one batch, and pack them."""
        for stray in (self.folder / work.id).glob(".layers-*"):  # a killed server left them
            shutil.rmtree(stray, ignore_errors=True)
        transfer = self._library.open_in_passing(self._data / "bakes" / f"{work.request.bake}.zarr")
        for index, partial in enumerate(work.request.looks):
            self.note(work.id, index)
            self._paint_frame(transfer, work, index, partial, timer.tell)
            timer.next_step()
        self._pack(work)

    def _paint_frame(
        self, transfer: Opened, work: Render, index: int, partial: dict[str, Any], tell: Progress
    ) -> None:
        path, request = self.frame_path(work, index), work.request
        if path.exists():
            return

        def render(look: Any, progress: Progress) -> F32:
            image = self._library.render(
                transfer, request.view, look, progress=progress, for_display=request.format != "exr",
                cancelled=lambda: not self.is_wanted(work.id),
            )  # fmt: skip
            return image if request.size is None else shrink(image, request.size)

        look = looks.validate(partial, transfer.default_look)
        if request.format == "exr":
            self._export(path, render, look, transfer, request, tell)
        else:
            write_image(path, render(look, tell), look.display.exposure, look.display.tone_map)

    def _export(
        self, path: Path, render: Any, look: Any, transfer: Opened, request: RenderRequest, progress: Progress
    ) -> None:
        view = transfer.views[request.view]
        layers = layers_of(look, reflects=Axis.BOUNCES in transfer.axes) if request.layers else []
        origin = Origin(transfer.scene_id, self._scene_name(transfer.scene_id), request.bake)
        size = request.size or (view.width, view.height)
        attributes = attributes_of(origin, view.camera, size, look, layers)
        export_exr(path, render, look, layers, attributes, request.precision, progress)

    def _pack(self, render: Render) -> None:
        with replacing(self.archive_path(render)) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            for index in range(render.total):
                archive.write(self.frame_path(render, index), self.download_name(render, index))


def _stem(render: Render) -> str:
    return safe_stem(render.request.name or render.request.view)
