"""How true a bake's frame is: passes of brute force, one after another, and what they say of the frame so far."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session, sessionmaker

from relume.reference.truth import Comparison
from server.apart.step import RunStep, Step
from server.apart.step_timer import StepTimer
from server.errors import BusyError
from server.queues.work_queue import Quota, Work, WorkQueue
from server.records.tables import ComparisonRow
from server.wire.bodies import TruthRequest

Comparing = Work[TruthRequest]


class ComparisonQueue(WorkQueue[TruthRequest]):
    """Comparisons in the database, what they found in `data`/truths/<id>/; a step is a pass."""

    row, noun, request_type = ComparisonRow, "comparison", TruthRequest

    def __init__(self, sessions: sessionmaker[Session], data: Path, run: RunStep, quota: Quota) -> None:
        """
        Args:
            sessions: of the database. data: directory of scenes, bakes and what is found.
            run: does the steps. quota: how much may wait.
        """
        super().__init__(sessions, data / "truths", run, quota)
        self._pass_s: dict[tuple[str, str], float] = {}
        self._sampling = threading.Lock()

    def steps(self, request: TruthRequest) -> int:
        """The passes."""
        return request.passes

    def step_s(self, request: TruthRequest) -> float | None:
        """As passes of this view took before."""
        return self._pass_s.get((request.bake, request.view))

    def is_first(self, request: TruthRequest) -> bool:
        """All of them take their time."""
        return False

    def seconds(self, request: TruthRequest) -> float:
        """What a comparison will take: as passes of this view took before, or as a small picture takes now.

        Raises:
            BusyError: another view is being tried out, and who asks would wait behind it.
            CancelledError: the server closes.
        """
        key = request.bake, request.view
        if key not in self._pass_s:
            if not self._sampling.acquire(blocking=False):
                raise BusyError("another comparison is being estimated; ask again in a moment")
            try:
                step = Step("time of a pass", is_first=True, values={"request": request.model_dump(mode="json")})
                self._pass_s[key] = self.run(step, lambda share: None, lambda: not self.is_closing)["seconds"]
            finally:
                self._sampling.release()
        return request.passes * self._pass_s[key]

    def picture_path(self, identity: str, name: str) -> Path:
        """File of a picture, "error" or "reference", there or not."""
        return self.folder / identity / f"{name}.png"

    def found(self, identity: str) -> Comparison | None:
        """What the passes so far say of the frame; None before the second."""
        path = self.folder / identity / "found.json"
        return Comparison(**json.loads(path.read_text())) if path.exists() else None

    def step(self, work: Comparing, timer: StepTimer) -> int:
        """Make the frame where it is missing, and a pass."""
        request = work.request
        values: dict[str, Any] = {"request": request.model_dump(mode="json"), "folder": str(self.folder / work.id)}
        self.note(work.id, work.done)
        done = int(self.run_apart(work, "frame of a comparison", values, lambda share: None)["passes"])
        if done >= work.total:
            return work.total
        self.note(work.id, done)
        timer.begin()
        done = int(self.run_apart(work, "pass of a comparison", values, timer.tell)["passes"])
        self._pass_s[request.bake, request.view] = timer.next_step()
        return done
