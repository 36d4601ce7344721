"""What is made beside the frames of a picture while a hand moves, as a session makes it."""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Self

import numpy as np

from relume.moving.picture import MovingPicture


class Beside:
    """A thread for what a picture waits for; use as a context.

    Attributes:
        lags_s: of each frame, how long ago the look was wanted whose light between surfaces it shows.
    """

    def __init__(self, picture: MovingPicture) -> None:
        self._picture, self._thread = picture, ThreadPoolExecutor(1)
        self._running: tuple[Any, Future[Any], float] | None = None
        self._wanted_s = self._of_shown_s = time.perf_counter()
        self.lags_s: list[float] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._thread.shutdown()

    def want(self) -> None:
        """Another look is wanted; what has been made goes in."""
        self._wanted_s = time.perf_counter()
        if self._running is not None and self._running[1].done():
            job, made, self._of_shown_s = self._running
            self._picture.install(job, made.result())
            self._running = None

    def go_on(self) -> None:
        """A frame is there; what it lacks is begun, where nothing else is made."""
        self.lags_s.append(time.perf_counter() - self._of_shown_s)
        job = self._picture.next_job() if self._running is None else None
        if job is not None and not job.refines:
            made = self._thread.submit(job.make, lambda share: None, lambda: False)
            self._running = job, made, self._wanted_s
        elif self._running is None:
            self._of_shown_s = self._wanted_s

    @property
    def lag_s(self) -> float:
        """The median."""
        return float(np.median(self.lags_s))
