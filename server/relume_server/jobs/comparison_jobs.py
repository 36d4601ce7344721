"""Comparisons: reference passes, one after another, and the error of a bake's frame so far."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, ValidationError

from relume.core.folder_size import folder_bytes
from relume.reference.comparison import Estimate
from relume_server.batch.reference_passes import FIGURES
from relume_server.jobs.render_jobs import HEAD_BYTES
from relume_server.schemas.base import Body
from relume_server.schemas.bodies import ComparisonFigures, ComparisonRequest
from relume_worker.jobs.job import Job
from relume_worker.jobs.job_kind import JobKind
from relume_worker.jobs.job_run import JobRun
from relume_worker.jobs.job_service import JobService
from relume_worker.jobs.step import Step

ANSWER_S = 1.5  # estimates must answer quickly
DEFAULT_PIXEL_S = 5e-4  # of one pass on one core, before any measurement: from the built-in scenes
ComparisonJob = Job[ComparisonRequest]
_Kind = tuple[str, str, tuple[int, int] | None, str]


class Figures(Body):
    """Results of a comparison; fields as in `ComparisonBody`."""

    omitted_paths: Annotated[list[str], Field(default_factory=list)]
    unsupported_paths: Annotated[list[str], Field(default_factory=list)]
    error_all_paths: ComparisonFigures | None = None
    error_method_paths: ComparisonFigures | None = None


class DurationEstimate(NamedTuple):
    """Estimated duration. is_measured: from passes of the same view."""

    seconds: float
    is_measured: bool


class ComparisonJobs(JobKind[ComparisonRequest]):
    """Comparisons with files in `data`/comparisons/<id>/; a step is one pass, added to the sum of earlier ones."""

    name, placeholder = "comparison", ComparisonRequest(bake="0" * 16, view="unknown", look={})

    def __init__(self, service: JobService, data: Path, report_bytes: Callable[[str, int], object]) -> None:
        """
        Args:
            service: runs the jobs. data: data directory.
            report_bytes: called with the id of a finished comparison, and the size of its files in bytes.
        """
        super().__init__(service, data / "comparisons")
        self._report_bytes = report_bytes
        self._pass_s: dict[_Kind, float] = {}
        self._pixel_s = DEFAULT_PIXEL_S
        self._sampler, self._sampling = ThreadPoolExecutor(1, "relume-pace"), threading.Lock()
        self._sample: Future[None] | None = None

    def steps(self, request: ComparisonRequest) -> int:
        """Number of passes."""
        return request.passes

    def step_s(self, request: ComparisonRequest) -> float | None:
        """Mean time of earlier passes of this view."""
        return self._pass_s.get(_kind(request))

    def is_first(self, request: ComparisonRequest) -> bool:
        """False: all comparisons take long."""
        return False

    def estimate_duration(self, request: ComparisonRequest, num_pixels: int) -> DurationEstimate:
        """Estimate the duration of a comparison, within `ANSWER_S` seconds.

        From earlier passes of this view, or from a small image that is rendered now; until that is done, and while
        another view is measured, from passes of other views.

        Args:
            request: the comparison. num_pixels: number of pixels of the image.
        """
        key = _kind(request)
        if key not in self._pass_s:
            self._await_sample(key, request)
        if key in self._pass_s:
            self._pixel_s = self._pass_s[key] / num_pixels
        pass_s = self._pass_s.get(key, num_pixels * self._pixel_s)
        return DurationEstimate(request.passes * pass_s, is_measured=key in self._pass_s)

    def _await_sample(self, key: _Kind, request: ComparisonRequest) -> None:
        """Start rendering a small image unless one is in progress, and wait a little for it. Raises its exceptions."""

        def sample() -> None:
            step = Step("time of a pass", is_first=True, values={"request": request.model_dump(mode="json")})
            self._pass_s[key] = self._service.run_step(step, lambda share: None, lambda: not self._service.is_closing)[
                "seconds"
            ]

        with self._sampling:
            if self._sample is None or self._sample.done():
                self._sample = self._sampler.submit(sample)
            pending = self._sample
        with suppress(TimeoutError):
            pending.result(ANSWER_S)

    def close(self) -> None:
        """Wait for a sample; the service is closing."""
        self._sampler.shutdown()

    def picture_path(self, identity: str, name: str) -> Path:
        """Image file, existing or not: "error" or "reference" for the requested paths, "method-error" or
        "method-reference" for the paths of the bake's method.
        """
        if self.get(identity).request.paths == "method":
            name = name.removeprefix("method-")
        return self.folder / identity / f"{name}.png"

    def figures(self, identity: str) -> Figures:
        """Errors of the frame from the passes so far."""
        try:
            return Figures.model_validate_json((self.folder / identity / FIGURES).read_bytes())
        except (FileNotFoundError, ValidationError):  # there are no passes yet, or another version wrote it
            return Figures.model_validate({})

    def run(self, run: JobRun[ComparisonRequest]) -> None:
        """Render the frame if it is missing, and the passes one after another."""
        job = run.job
        values: dict[str, Any] = {"request": job.request.model_dump(mode="json"), "folder": str(run.folder)}
        run.record(job.completed)
        done = int(run.step("frame of a comparison", values)["passes"])
        while done < job.total:
            run.record(done)
            done = int(run.timed_step(done, "pass of a comparison", values)["passes"])
            if (pass_s := run.timer.step_s) is not None:
                self._pass_s[_kind(job.request)] = pass_s
        run.record(done)  # the lease may be lost by now
        self._report_bytes(job.id, folder_bytes(run.folder))


def planned_bytes(request: ComparisonRequest, size: tuple[int, int]) -> int:
    """Upper bound of the size of a comparison's files: the frame, and sums and uncompressed images per set of paths.

    Args:
        request: the comparison. size: size of the image, pixels.
    """
    width, height = size
    pixels, num_sets = width * height, len({request.paths, "method"})
    frame_bytes = pixels * 3 * np.dtype(np.float32).itemsize + HEAD_BYTES
    return frame_bytes + num_sets * (Estimate.planned_bytes(height, width) + 2 * (3 * pixels + HEAD_BYTES))


def _kind(request: ComparisonRequest) -> _Kind:
    """Key of comparisons whose passes take about the same time, for any position of a free camera."""
    return request.bake, request.view, request.size, request.paths
