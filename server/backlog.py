"""Long work that outlives the server: rows of a table, one thread that works through them, oldest first.

A row is queued, running, ready, failed or stopped. What a killed server left running is gone on with at the next
start; the work itself must keep on disk what it has done.
"""

from __future__ import annotations

import json
import logging
import secrets
import shutil
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from sqlalchemy import CursorResult, select, update
from sqlalchemy.orm import Session, sessionmaker

from relume.errors import CancelledError, NotFoundError, RelumeError
from relume.memory import give_back
from server.errors import BusyError, problem_of
from server.tables import WorkRow

log = logging.getLogger(__name__)
MAX_QUEUED = 100
_LOOK_AGAIN_S = 2.0
_ASK_AGAIN_S = 0.1
_ACTIVE = ("queued", "running")


@dataclass(frozen=True)
class Work:
    """One row at one moment. `request` is the body as JSON."""

    id: str
    request: dict[str, Any]
    state: str
    done: int
    problem: str | None


class Backlog:
    """Rows of one kind; their files lie in `folder`/<id>/.

    Args:
        row: the table. noun: what people call a row. work: does one, tells `note`, ends by returning.
    """

    def __init__(
        self,
        sessions: sessionmaker[Session],
        folder: Path,
        row: type[WorkRow],
        noun: str,
        work: Callable[[Work], None],
    ) -> None:
        self._sessions, self._row, self._noun, self._work = sessions, row, noun, work
        self.folder = folder
        self._wake, self._closing = threading.Event(), threading.Event()
        self._wanted: tuple[str, float] = "", 0.0
        self._thread = threading.Thread(target=self._run, name=f"relume-{noun}s", daemon=True)

    def start(self) -> None:
        """Go on with what was left."""
        self._thread.start()

    def close(self) -> None:
        """Finish the step at hand and stop; the rest is for the next start."""
        self._closing.set()
        self._wake.set()
        self._thread.join(timeout=30)

    def submit(self, request: str) -> str:
        """Queue a request, JSON that was checked. Raises BusyError."""
        identity, row = secrets.token_hex(8), self._row
        with self._sessions.begin() as session:
            waiting = session.scalars(select(row.id).where(row.state.in_(_ACTIVE)))
            if len(waiting.all()) >= MAX_QUEUED:
                raise BusyError(f"{MAX_QUEUED} {self._noun}s are waiting; try again when some are done")
            session.add(row(id=identity, request=request, state="queued", done=0, created=time.time()))
        self._wake.set()
        return identity

    def get(self, identity: str) -> Work:
        """A row. Raises NotFoundError."""
        with self._sessions() as session:
            row = session.get(self._row, identity)
        if row is None:
            raise NotFoundError(f"there is no {self._noun} {identity[:40]}; start one first")
        return Work(row.id, json.loads(row.request), row.state, row.done, row.problem)

    def delete(self, identity: str) -> None:
        """Stop the work and forget its files. Raises NotFoundError."""
        self.get(identity)
        with self._sessions.begin() as session:
            if (row := session.get(self._row, identity)) is not None:
                session.delete(row)
        shutil.rmtree(self.folder / identity, ignore_errors=True)

    def stop(self, identity: str) -> None:
        """End work that waits or goes on; its files stay, `resume` goes on with them. Raises NotFoundError."""
        self.get(identity)
        self._update(identity, _ACTIVE, state="stopped")

    def resume(self, identity: str) -> None:
        """Queue what was stopped again. Raises NotFoundError."""
        self.get(identity)
        self._update(identity, ("stopped",), state="queued")
        self._wake.set()

    def note(self, identity: str, done: int, state: str = "running") -> None:
        """Record progress. Raises CancelledError where the work was stopped, its row deleted, or the server closes."""
        if not self._update(identity, _ACTIVE, state=state, done=done) or (self.is_closing and state == "running"):
            raise CancelledError(f"the {self._noun} was stopped")

    @property
    def is_closing(self) -> bool:
        """Whether the work at hand should stop."""
        return self._closing.is_set()

    def is_wanted(self, identity: str) -> bool:
        """Whether nobody has stopped the work or deleted its row, some moments ago, and the server goes on."""
        if self.is_closing:
            return False
        if self._wanted[0] == identity and time.monotonic() < self._wanted[1]:
            return True  # work asks thousands of times a second
        with self._sessions() as session:
            row = session.get(self._row, identity)
            is_wanted = row is not None and row.state in _ACTIVE
        self._wanted = identity if is_wanted else "", time.monotonic() + _ASK_AGAIN_S
        return is_wanted

    def _update(self, identity: str, states: Sequence[str], **values: Any) -> bool:
        row = self._row
        statement = update(row).where(row.id == identity, row.state.in_(states)).values(**values)
        with self._sessions.begin() as session:
            return cast("CursorResult[Any]", session.execute(statement)).rowcount > 0

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                identity = self._next()
                if identity is not None:
                    self._do(self.get(identity))
                    give_back()
                    continue
            except Exception:  # the database may be away for a while; the thread must outlive that
                log.exception("the queue of %ss cannot be read; trying again", self._noun)
            self._wake.wait(timeout=_LOOK_AGAIN_S)
            self._wake.clear()

    def _next(self) -> str | None:
        row = self._row
        query = select(row.id).where(row.state.in_(_ACTIVE)).order_by(row.created)
        with self._sessions() as session:
            return session.scalars(query.limit(1)).first()

    def _do(self, work: Work) -> None:
        """One row; every failure ends in it as a sentence."""
        folder = self.folder / work.id
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._work(work)
        except CancelledError:  # closing, stopped, or deleted
            if not self._is_there(work.id):
                shutil.rmtree(folder, ignore_errors=True)
        except Exception as error:
            if not isinstance(error, RelumeError | OSError):
                log.exception("%s %s failed", self._noun, work.id)
            self._update(work.id, _ACTIVE, state="failed", problem=problem_of(error).detail)

    def _is_there(self, identity: str) -> bool:
        with self._sessions() as session:
            return session.get(self._row, identity) is not None
