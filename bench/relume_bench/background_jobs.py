"""Background jobs of an image during a drag, as a session runs them."""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Self

import numpy as np

from relume.live.fixed_camera.picture import Picture
from relume.live.free_camera.free_camera_picture import FreeCameraPicture


class BackgroundJobs:
    """A thread for the jobs of an image; a context manager.

    Attributes:
        lags_s: for each frame, the age of the look whose indirect light it shows.
    """

    def __init__(self, picture: FreeCameraPicture | Picture) -> None:
        self._picture, self._thread = picture, ThreadPoolExecutor(1)
        self._running: tuple[Any, Future[Any], float] | None = None
        self._requested_s = self._displayed_request_s = time.perf_counter()
        self.lags_s: list[float] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._thread.shutdown()

    def request(self) -> None:
        """Request another look, and install finished results."""
        self._requested_s = time.perf_counter()
        if self._running is not None and self._running[1].done():
            job, future, self._displayed_request_s = self._running
            job.apply(future.result())
            self._running = None

    def start_next(self) -> None:
        """Start the next job after a frame, unless one is running."""
        job = self._picture.next_job() if self._running is None else None
        if job is not None and not job.is_refinement:
            future = self._thread.submit(job.run, lambda share: None, lambda: False)
            self._running = job, future, self._requested_s
        elif self._running is None:
            self._displayed_request_s = self._requested_s
        self.lags_s.append(time.perf_counter() - self._displayed_request_s)

    @property
    def lag_s(self) -> float:
        """Median lag."""
        return float(np.median(self.lags_s))
