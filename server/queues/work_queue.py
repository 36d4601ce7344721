"""The one queue of long work: rows of a table, and one thread that works through them, oldest first.

A row is queued, running, ready, failed or stopped. What a killed server left running is gone on with at the next
start; the work itself must keep on disk what it has done.

Libraries for this (Celery, Dramatiq, RQ, Huey) run functions in processes of their own behind a broker. Here the row is
what REST answers, stops, resumes and forgets, the work shares the opened bakes and the memory of this process, and a
server needs nothing beside its database.
"""

from __future__ import annotations

import logging
import secrets
import shutil
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar, cast

from pydantic import BaseModel
from sqlalchemy import CursorResult, select, update
from sqlalchemy.orm import Session, sessionmaker

from relume.errors import CancelledError, NotFoundError, RelumeError
from relume.resident import give_back
from server.errors import BusyError, problem_of
from server.queues.step_timer import StepTimer
from server.records.tables import WorkRow

log = logging.getLogger(__name__)
MAX_QUEUED = 100
_LOOK_AGAIN_S = 2.0
_ASK_AGAIN_S = 0.1
_ACTIVE = ("queued", "running")

Request = TypeVar("Request", bound=BaseModel)


@dataclass(frozen=True)
class Work(Generic[Request]):
    """One row at one moment.

    Attributes:
        request: the body of the call that asked for it.
        done, total: steps. progress: 0…1; what is done of the step at hand counts too.
        seconds_left: None where the work does not run, or nothing was measured yet.
        problem: why it failed, one sentence.
    """

    id: str
    request: Request
    state: str
    done: int
    total: int
    progress: float
    seconds_left: float | None
    problem: str | None


class WorkQueue(ABC, Generic[Request]):
    """Work of one kind; its files lie in `folder`/<id>/.

    A kind says which table its rows are in, what people call one of them, what a request is, how many steps it takes,
    and how it is done.
    """

    row: ClassVar[type[WorkRow]]
    noun: ClassVar[str]
    request_type: type[Request]

    def __init__(self, sessions: sessionmaker[Session], folder: Path) -> None:
        """
        Args:
            sessions: of the database. folder: made where it is missing.
        """
        self._sessions, self.folder = sessions, folder
        self._wake, self._closing = threading.Event(), threading.Event()
        self._wanted: tuple[str, float] = "", 0.0
        self._running: tuple[str, StepTimer] = "", StepTimer(None)
        self._thread = threading.Thread(target=self._run, name=f"relume-{self.noun}s", daemon=True)

    @abstractmethod
    def steps(self, request: Request) -> int:
        """How many steps a request takes, at least one."""

    @abstractmethod
    def step_s(self, request: Request) -> float | None:
        """Seconds that a step of such a request has taken before; None where that is not known."""

    @abstractmethod
    def work(self, work: Work[Request], timer: StepTimer) -> None:
        """Do what is not done yet; calls `note` before each step, tells `timer`, and ends by returning.

        Raises:
            CancelledError: `note` said so, or `is_wanted` did in the middle of a step.
        """

    def start(self) -> None:
        """Go on with what was left."""
        self._thread.start()

    def close(self) -> None:
        """Finish the step at hand and stop; the rest is for the next start."""
        self._closing.set()
        self._wake.set()
        self._thread.join(timeout=30)

    def submit(self, request: Request) -> str:
        """Queue a request that was checked; returns its id. Raises BusyError."""
        identity, row = secrets.token_hex(8), self.row
        with self._sessions.begin() as session:
            waiting = session.scalars(select(row.id).where(row.state.in_(_ACTIVE)))
            if len(waiting.all()) >= MAX_QUEUED:
                raise BusyError(f"{MAX_QUEUED} {self.noun}s are waiting; try again when some are done")
            text = request.model_dump_json()
            session.add(row(id=identity, request=text, state="queued", done=0, created=time.time()))
        self._wake.set()
        return identity

    def get(self, identity: str) -> Work[Request]:
        """A row. Raises NotFoundError."""
        with self._sessions() as session:
            row = session.get(self.row, identity)
        if row is None:
            raise NotFoundError(f"there is no {self.noun} {identity[:40]}; start one first")
        request = self.request_type.model_validate_json(row.request)
        running, timer = self._running
        total, is_running = self.steps(request), row.state == "running" and running == identity
        progress = min(1.0, (row.done + (timer.share if is_running else 0.0)) / total)
        seconds_left = timer.seconds_left(total - row.done) if is_running else None
        return Work(row.id, request, row.state, row.done, total, progress, seconds_left, row.problem)

    def delete(self, identity: str) -> None:
        """Stop the work and forget its files. Raises NotFoundError."""
        self.get(identity)
        with self._sessions.begin() as session:
            if (row := session.get(self.row, identity)) is not None:
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

    def note(self, identity: str, done: int) -> None:
        """Record progress. Raises CancelledError where the work was stopped, its row deleted, or the server closes."""
        if not self._update(identity, _ACTIVE, state="running", done=done) or self.is_closing:
            raise CancelledError(f"the {self.noun} was stopped")

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
            row = session.get(self.row, identity)
            is_wanted = row is not None and row.state in _ACTIVE
        self._wanted = identity if is_wanted else "", time.monotonic() + _ASK_AGAIN_S
        return is_wanted

    def _update(self, identity: str, states: Sequence[str], **values: Any) -> bool:
        row = self.row
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
                log.exception("the queue of %ss cannot be read; trying again", self.noun)
            self._wake.wait(timeout=_LOOK_AGAIN_S)
            self._wake.clear()

    def _next(self) -> str | None:
        row = self.row
        query = select(row.id).where(row.state.in_(_ACTIVE)).order_by(row.created)
        with self._sessions() as session:
            return session.scalars(query.limit(1)).first()

    def _do(self, work: Work[Request]) -> None:
        """One row; every failure ends in it as a sentence."""
        folder, timer = self.folder / work.id, StepTimer(self.step_s(work.request))
        self._running = work.id, timer
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.work(work, timer)
            self._update(work.id, _ACTIVE, state="ready", done=work.total)
        except CancelledError:  # closing, stopped, or deleted
            pass
        except Exception as error:
            if not isinstance(error, RelumeError | OSError):
                log.exception("%s %s failed", self.noun, work.id)
            self._update(work.id, _ACTIVE, state="failed", problem=problem_of(error).detail)
        finally:
            self._running = "", StepTimer(None)
        if not self._is_there(work.id):
            shutil.rmtree(folder, ignore_errors=True)

    def _is_there(self, identity: str) -> bool:
        with self._sessions() as session:
            return session.get(self.row, identity) is not None
