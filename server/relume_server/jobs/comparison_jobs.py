"""How true a bake's frame is: passes of brute force, one after another, and what they say of the frame so far."""

from __future__ import annotations

import threading
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field
from sqlalchemy.orm import Session, sessionmaker

from relume_server.batch.reference_passes import FIGURES
from relume_server.batch.step import RunStep, Step
from relume_server.batch.step_timer import StepTimer
from relume_server.jobs.job import Job, Quota
from relume_server.jobs.queue import JobQueue
from relume_server.persistence.tables import ComparisonRow
from relume_server.schemas.base import Body
from relume_server.schemas.bodies import ComparisonFigures, ComparisonRequest

ANSWER_S = 1.5  # who asks how long it takes wants to know at once
DEFAULT_PIXEL_S = 5e-4  # of a pass, before any was measured: of the built-in scenes, by one core
ComparisonJob = Job[ComparisonRequest]
_Kind = tuple[str, str, tuple[int, int] | None, str]


class Figures(Body):
    """What a comparison has found; fields as of `ComparisonBody`."""

    omitted_paths: Annotated[list[str], Field(default_factory=list)]
    unsupported_paths: Annotated[list[str], Field(default_factory=list)]
    error_all_paths: ComparisonFigures | None = None
    error_method_paths: ComparisonFigures | None = None


class DurationEstimate(NamedTuple):
    """How long something will take. is_measured: judged by passes of the same view, not of others."""

    seconds: float
    is_measured: bool


class ComparisonQueue(JobQueue[ComparisonRequest]):
    """Comparisons in the database, what they found in `data`/comparisons/<id>/; a step is a pass."""

    row, noun, request_type = ComparisonRow, "comparison", ComparisonRequest

    def __init__(self, sessions: sessionmaker[Session], data: Path, run: RunStep, quota: Quota) -> None:
        """
        Args:
            sessions: of the database. data: directory of scenes, bakes and what is found.
            run: does the steps. quota: how much may wait.
        """
        super().__init__(sessions, data / "comparisons", run, quota)
        self._pass_s: dict[_Kind, float] = {}
        self._pixel_s = DEFAULT_PIXEL_S
        self._sampler, self._sampling = ThreadPoolExecutor(1, "relume-pace"), threading.Lock()
        self._sample: Future[None] | None = None

    def steps(self, request: ComparisonRequest) -> int:
        """The passes."""
        return request.passes

    def step_s(self, request: ComparisonRequest) -> float | None:
        """As passes of this view took before."""
        return self._pass_s.get(_kind(request))

    def is_first(self, request: ComparisonRequest) -> bool:
        """All of them take their time."""
        return False

    def estimate_duration(self, request: ComparisonRequest, num_pixels: int) -> DurationEstimate:
        """What a comparison will take, told within `ANSWER_S` seconds.

        As passes of this view took before, or as a small picture takes now; until that is done, and where another view
        is being tried out, as passes of other views took.

        Args:
            num_pixels: of the picture that is compared.
        """
        key = _kind(request)
        if key not in self._pass_s:
            self._await_sample(key, request)
        if key in self._pass_s:
            self._pixel_s = self._pass_s[key] / num_pixels
        pass_s = self._pass_s.get(key, num_pixels * self._pixel_s)
        return DurationEstimate(request.passes * pass_s, is_measured=key in self._pass_s)

    def _await_sample(self, key: _Kind, request: ComparisonRequest) -> None:
        """Have a small picture made where none is being made, and wait for it a little. Raises what making it did."""

        def sample() -> None:
            step = Step("time of a pass", is_first=True, values={"request": request.model_dump(mode="json")})
            self._pass_s[key] = self.run(step, lambda share: None, lambda: not self.is_closing)["seconds"]

        with self._sampling:
            if self._sample is None or self._sample.done():
                self._sample = self._sampler.submit(sample)
            pending = self._sample
        with suppress(TimeoutError):
            pending.result(ANSWER_S)

    def close(self) -> None:
        """See `JobQueue`."""
        super().close()
        self._sampler.shutdown()

    def picture_path(self, identity: str, name: str) -> Path:
        """File of a picture, there or not: "error" or "reference" of the paths that were asked for, "method-error" or
        "method-reference" of those that the method follows."""
        if self.get(identity).request.paths == "method":
            name = name.removeprefix("method-")
        return self.folder / identity / f"{name}.png"

    def figures(self, identity: str) -> Figures:
        """What the passes so far say of the frame."""
        path = self.folder / identity / FIGURES
        return Figures.model_validate_json(path.read_text()) if path.exists() else Figures.model_validate({})

    def step(self, job: ComparisonJob, timer: StepTimer) -> int:
        """Make the frame where it is missing, and a pass."""
        request = job.request
        values: dict[str, Any] = {"request": request.model_dump(mode="json"), "folder": str(self.folder / job.id)}
        self.record_progress(job.id, job.completed)
        done = int(self.run_in_process(job, "frame of a comparison", values, lambda share: None)["passes"])
        if done >= job.total:
            return job.total
        self.record_progress(job.id, done)
        timer.start()
        done = int(self.run_in_process(job, "pass of a comparison", values, timer.report)["passes"])
        self._pass_s[_kind(request)] = timer.next_step()
        return done


def _kind(request: ComparisonRequest) -> _Kind:
    """Passes of one kind take about as long as each other, wherever an eye is that moves."""
    return request.bake, request.view, request.size, request.paths
