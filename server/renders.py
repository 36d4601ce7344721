"""Batch renders: one look after another; what is on disk is not painted again after a restart."""

from __future__ import annotations

import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session, sessionmaker

from relume import look as looks
from relume.imageio import write_image
from relume.shrink import shrink
from server.backlog import Backlog, Work
from server.bodies import RenderRequest
from server.live.ports import Library, Transfer
from server.tables import RenderRow


@dataclass(frozen=True)
class RenderStatus:
    """One batch at one moment."""

    id: str
    request: RenderRequest
    state: str
    done: int
    problem: str | None


class RenderQueue:
    """Batches in the database, pictures in `data`/renders/<id>/."""

    def __init__(self, sessions: sessionmaker[Session], data: Path, library: Library) -> None:
        self._data, self._library = data, library
        self._backlog = Backlog(sessions, data / "renders", RenderRow, "render", self._paint)
        self.start, self.close, self.delete = self._backlog.start, self._backlog.close, self._backlog.delete

    def submit(self, request: RenderRequest) -> str:
        """Queue a batch whose looks were checked. Raises BusyError."""
        return self._backlog.submit(request.model_dump_json())

    def get(self, identity: str) -> RenderStatus:
        """A batch. Raises NotFoundError."""
        return _status(self._backlog.get(identity))

    def frame_path(self, status: RenderStatus, index: int) -> Path:
        """File of one picture, there or not."""
        return self._backlog.folder / status.id / f"{index:04d}.{status.request.format}"

    def archive_path(self, status: RenderStatus) -> Path:
        """The finished batch in one file."""
        return self._backlog.folder / status.id / "archive.zip"

    def _paint(self, work: Work) -> None:
        """All pictures of one batch."""
        status = _status(work)
        transfer = self._library.open_transfer(self._data / "bakes" / f"{status.request.bake}.zarr")
        for index, partial in enumerate(status.request.looks):
            self._backlog.note(status.id, index)
            self._paint_frame(transfer, status, index, partial)
        self._pack(status)
        self._backlog.note(status.id, len(status.request.looks), state="ready")

    def _paint_frame(self, transfer: Transfer, status: RenderStatus, index: int, partial: dict[str, Any]) -> None:
        path = self.frame_path(status, index)
        if path.exists():
            return
        request = status.request
        look = looks.validate(partial, transfer.default_look)
        image = self._library.render(transfer, request.view, look, for_display=request.format != "exr")
        image = image if request.size is None else shrink(image, request.size)
        write_image(path, image, look.display.exposure, look.display.tone_map)

    def _pack(self, status: RenderStatus) -> None:
        target = self.archive_path(status)
        unfinished = target.with_name("unfinished.zip")
        with zipfile.ZipFile(unfinished, "w", zipfile.ZIP_STORED) as archive:
            for index in range(len(status.request.looks)):
                path = self.frame_path(status, index)
                archive.write(path, path.name)
        os.replace(unfinished, target)


def _status(work: Work) -> RenderStatus:
    return RenderStatus(work.id, RenderRequest(**work.request), work.state, work.done, work.problem)
