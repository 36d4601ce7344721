"""How far a bake is, and how long it still takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

from relume.transfer.base import Plan, Task
from worker.status import TaskCost

# Between two finished tasks the bar moves on at the rate so far, but never past this part of the next task.
FORESIGHT = 0.9


class Progress:
    """Fraction done, rate and time left of one run of a bake.

    Earlier stages count by their rays against the plan's; the tasks of the last stage, by far the longest, are known
    from its start, so what is left then is divided among its rows. Rate and time left are those of the stage that runs.
    """

    def __init__(self, plan: Plan, shown: float = 0.0, clock: Callable[[], float] = time.monotonic) -> None:
        """
        Args:
            shown: what people have seen already, before an interruption.
            clock: seconds.
        """
        self._clock = clock
        self._num_rays = max(1, plan.num_rays)
        self._rays = 0
        self._base = self._done = 0.0
        self._shown = shown
        self._rows = self._largest = 0
        self._rays_here, self._gained = 0, 0.0
        self._began, self._last_s = clock(), 0.0

    def begin_stage(self, tasks: Collection[Task], last: bool) -> None:
        """Note the tasks of a stage."""
        if last:
            rows = [task.stop - task.start for task in tasks]
            self._rows, self._largest, self._base = sum(rows), max(rows, default=0), self._done
        self._begin()

    def add(self, task: Task, cost: TaskCost, here: bool) -> None:
        """Count a finished task; `here`: in this run, not one before an interruption."""
        before = self._done
        self._rays += cost.rays
        if self._rows:
            self._done += (1 - self._base) * (task.stop - task.start) / self._rows
        else:
            self._done = min(0.5, self._rays / self._num_rays)
        if here:
            self._rays_here += cost.rays
            self._gained += self._done - before
            self._last_s = self._clock() - self._began

    def fields(self) -> dict[str, float | None]:
        """As the ledger keeps them: progress from 0 to 1 that never falls, rays per second, seconds left."""
        since_s = self._clock() - self._began - self._last_s
        per_second = self._gained / max(1e-3, self._last_s) if self._rows else 0.0
        if per_second:
            step = FORESIGHT * (1 - self._base) * self._largest / self._rows
            self._shown = max(self._shown, min(1.0, self._done + min(step, per_second * since_s)))
        self._shown = max(self._shown, self._done)
        return {
            "progress": self._shown,
            "rays_per_second": self._rays_here / max(1e-3, self._last_s) if self._rays_here else None,
            "seconds_left": max(0.0, (1 - self._done) / per_second - since_s) if per_second else None,
        }

    def _begin(self) -> None:
        self._began, self._last_s = self._clock(), 0.0
        self._rays_here, self._gained = 0, 0.0
