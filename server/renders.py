"""Batch renders: one look after another; what is on disk is not painted again after a restart."""

from __future__ import annotations

import os
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session, sessionmaker

from relume import look as looks
from relume.exr.attributes import Origin, attributes_of
from relume.exr.layers import layers_of
from relume.exr.picture import Progress, export_exr
from relume.imageio import write_image
from relume.shrink import shrink
from server.backlog import Backlog, Work
from server.bodies import RenderRequest
from server.downloads import safe_stem
from server.live.ports import F32, Library, Transfer
from server.tables import RenderRow


@dataclass(frozen=True)
class RenderStatus:
    """One batch at one moment; `progress` 0…1."""

    id: str
    request: RenderRequest
    state: str
    done: int
    progress: float
    problem: str | None


class RenderQueue:
    """Batches in the database, pictures in `data`/renders/<id>/.

    Args:
        scene_name: of a scene's id.
    """

    def __init__(
        self, sessions: sessionmaker[Session], data: Path, library: Library, scene_name: Callable[[str], str]
    ) -> None:
        self._data, self._library, self._scene_name = data, library, scene_name
        self._backlog = Backlog(sessions, data / "renders", RenderRow, "render", self._paint)
        self._shares: dict[str, float] = {}
        self.start, self.close, self.delete = self._backlog.start, self._backlog.close, self._backlog.delete

    def submit(self, request: RenderRequest) -> str:
        """Queue a batch whose looks were checked. Raises BusyError."""
        return self._backlog.submit(request.model_dump_json())

    def get(self, identity: str) -> RenderStatus:
        """A batch. Raises NotFoundError."""
        return self._status(self._backlog.get(identity))

    def frame_path(self, status: RenderStatus, index: int) -> Path:
        """File of one picture, there or not."""
        return self._backlog.folder / status.id / f"{index:04d}.{status.request.format}"

    def download_name(self, status: RenderStatus, index: int) -> str:
        """What the file of one picture is called where it is saved."""
        number = f"-{index:04d}" if len(status.request.looks) > 1 else ""
        return f"{_stem(status)}{number}.{status.request.format}"

    def archive_name(self, status: RenderStatus) -> str:
        """What the file of all pictures is called where it is saved."""
        return f"{_stem(status)}.zip"

    def archive_path(self, status: RenderStatus) -> Path:
        """The finished batch in one file."""
        return self._backlog.folder / status.id / "archive.zip"

    def _status(self, work: Work) -> RenderStatus:
        request = RenderRequest(**work.request)
        share = self._shares.get(work.id, 0.0) if work.state == "running" else 0.0
        progress = min(1.0, (work.done + share) / len(request.looks))
        return RenderStatus(work.id, request, work.state, work.done, progress, work.problem)

    def _paint(self, work: Work) -> None:
        """All pictures of one batch."""
        status = self._status(work)
        for stray in (self._backlog.folder / work.id).glob(".layers-*"):  # a killed server left them
            shutil.rmtree(stray, ignore_errors=True)
        transfer = self._library.open_transfer(self._data / "bakes" / f"{status.request.bake}.zarr")
        try:
            for index, partial in enumerate(status.request.looks):
                self._shares[work.id] = 0.0
                self._backlog.note(work.id, index)
                self._paint_frame(transfer, status, index, partial)
        finally:
            self._shares.pop(work.id, None)
        self._pack(status)
        self._backlog.note(status.id, len(status.request.looks), state="ready")

    def _paint_frame(self, transfer: Transfer, status: RenderStatus, index: int, partial: dict[str, Any]) -> None:
        path = self.frame_path(status, index)
        if path.exists():
            return
        request = status.request

        def tell(share: float) -> None:
            self._shares[status.id] = share

        def render(look: Any, progress: Progress) -> F32:
            image = self._library.render(
                transfer, request.view, look, progress=progress, for_display=request.format != "exr",
                cancelled=lambda: not self._backlog.is_wanted(status.id),
            )  # fmt: skip
            return image if request.size is None else shrink(image, request.size)

        look = looks.validate(partial, transfer.default_look)
        if request.format == "exr":
            self._export(path, render, look, transfer, request, tell)
        else:
            write_image(path, render(look, tell), look.display.exposure, look.display.tone_map)

    def _export(
        self, path: Path, render: Any, look: Any, transfer: Transfer, request: RenderRequest, progress: Progress
    ) -> None:
        view = transfer.views[request.view]
        layers = layers_of(look, reflects=transfer.method == "gather") if request.layers else []
        origin = Origin(transfer.scene_id, self._scene_name(transfer.scene_id), request.bake)
        size = request.size or (view.width, view.height)
        attributes = attributes_of(origin, view.camera, size, look, layers)
        export_exr(path, render, look, layers, attributes, request.precision, progress)

    def _pack(self, status: RenderStatus) -> None:
        target = self.archive_path(status)
        unfinished = target.with_name("unfinished.zip")
        with zipfile.ZipFile(unfinished, "w", zipfile.ZIP_STORED) as archive:
            for index in range(len(status.request.looks)):
                archive.write(self.frame_path(status, index), self.download_name(status, index))
        os.replace(unfinished, target)


def _stem(status: RenderStatus) -> str:
    return safe_stem(status.request.name or status.request.view)
