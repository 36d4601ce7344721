"""Batch renders: a thread that paints one look after another; what is on disk is not painted again after a restart."""

from __future__ import annotations

import json
import logging
import os
import secrets
import shutil
import threading
import time
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from sqlalchemy import CursorResult, select, update
from sqlalchemy.orm import Session, sessionmaker

from relume import look as looks
from relume.errors import CancelledError, NotFoundError, RelumeError
from relume.imageio import write_image
from server.bodies import RenderRequest
from server.errors import BusyError, problem_of
from server.live.ports import Library, Transfer
from server.shrink import shrink
from server.tables import RenderRow

log = logging.getLogger(__name__)
MAX_QUEUED = 100


@dataclass(frozen=True)
class RenderStatus:
    """One batch at one moment."""

    id: str
    request: RenderRequest
    state: str
    done: int
    problem: str | None


class RenderQueue:
    """Batches in the database, pictures in `folder`/<id>/, one thread that works through them."""

    def __init__(self, sessions: sessionmaker[Session], data: Path, library: Library) -> None:
        self._sessions, self._data, self._library = sessions, data, library
        self._folder = data / "renders"
        self._wake, self._closing = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="relume-renders", daemon=True)

    def start(self) -> None:
        """Go on with what was left."""
        self._thread.start()

    def close(self) -> None:
        """Finish the picture at hand and stop; the rest is for the next start."""
        self._closing.set()
        self._wake.set()
        self._thread.join(timeout=30)

    def submit(self, request: RenderRequest) -> str:
        """Queue a batch whose looks were checked. Raises BusyError."""
        identity = secrets.token_hex(8)
        with self._sessions.begin() as session:
            waiting = session.scalars(select(RenderRow.id).where(RenderRow.state.in_(("queued", "running"))))
            if len(waiting.all()) >= MAX_QUEUED:
                raise BusyError(f"{MAX_QUEUED} batches are waiting; try again when some are done")
            text = request.model_dump_json()
            session.add(RenderRow(id=identity, request=text, state="queued", done=0, problem=None, created=time.time()))
        self._wake.set()
        return identity

    def get(self, identity: str) -> RenderStatus:
        """A batch. Raises NotFoundError."""
        with self._sessions() as session:
            row = session.get(RenderRow, identity)
        if row is None:
            raise NotFoundError(f"there is no render {identity[:40]}; start one first")
        return RenderStatus(row.id, RenderRequest(**json.loads(row.request)), row.state, row.done, row.problem)

    def delete(self, identity: str) -> None:
        """Stop a batch and forget its pictures. Raises NotFoundError."""
        self.get(identity)
        with self._sessions.begin() as session:
            if (row := session.get(RenderRow, identity)) is not None:
                session.delete(row)
        shutil.rmtree(self._folder / identity, ignore_errors=True)

    def frame_path(self, status: RenderStatus, index: int) -> Path:
        """File of one picture, there or not."""
        return self._folder / status.id / f"{index:04d}.{status.request.format}"

    def archive_path(self, status: RenderStatus) -> Path:
        """The finished batch in one file."""
        return self._folder / status.id / "archive.zip"

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                identity = self._next()
                if identity is not None:
                    self._paint(self.get(identity))
                    continue
            except Exception:  # the database may be away for a while; the thread must outlive that
                log.exception("the render queue cannot be read; trying again")
            self._wake.wait(timeout=2.0)
            self._wake.clear()

    def _next(self) -> str | None:
        query = select(RenderRow.id).where(RenderRow.state.in_(("queued", "running"))).order_by(RenderRow.created)
        with self._sessions() as session:
            return session.scalars(query.limit(1)).first()

    def _paint(self, status: RenderStatus) -> None:
        """All pictures of one batch; every failure ends in its row as a sentence."""
        try:
            (self._folder / status.id).mkdir(parents=True, exist_ok=True)
            transfer = self._library.open_transfer(self._data / "bakes" / f"{status.request.bake}.zarr")
            for index, partial in enumerate(status.request.looks):
                self._note(status.id, "running", index)
                self._paint_frame(transfer, status, index, partial)
            self._pack(status)
            self._note(status.id, "ready", len(status.request.looks))
        except CancelledError:  # closing, or deleted
            if not self._exists(status.id):
                shutil.rmtree(self._folder / status.id, ignore_errors=True)
        except Exception as error:
            if not isinstance(error, RelumeError | OSError):
                log.exception("render %s failed", status.id)
            self._note_failure(status.id, problem_of(error).detail)

    def _paint_frame(self, transfer: Transfer, status: RenderStatus, index: int, partial: dict[str, Any]) -> None:
        path = self.frame_path(status, index)
        if path.exists():
            return
        request = status.request
        look = looks.validate(partial, transfer.default_look)
        image = self._library.render(transfer, request.view, look)
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

    def _note(self, identity: str, state: str, done: int) -> None:
        """Record progress. Raises CancelledError where the batch was deleted or the server closes."""
        statement = update(RenderRow).where(RenderRow.id == identity).values(state=state, done=done)
        with self._sessions.begin() as session:
            num_changed = cast("CursorResult[Any]", session.execute(statement)).rowcount
        if num_changed == 0 or (self._closing.is_set() and state == "running"):
            raise CancelledError("the batch was stopped")

    def _note_failure(self, identity: str, problem: str) -> None:
        with self._sessions.begin() as session:
            session.execute(update(RenderRow).where(RenderRow.id == identity).values(state="failed", problem=problem))

    def _exists(self, identity: str) -> bool:
        with self._sessions() as session:
            return session.get(RenderRow, identity) is not None
