"""How far a bake is, and how long it still takes."""

from __future__ import annotations

import time
from collections.abc import Collection

from relume.transfer.base import Plan, Task
from worker.status import TaskCost


class Progress:
    """Fraction done, rate and time left of one run of a bake.

    Earlier stages count by their rays against the plan; only the last stage's tasks are known from its start, so what
    is left then is divided among its rows.
    """

    def __init__(self, plan: Plan) -> None:
        self._num_rays = max(1, plan.num_rays)
        self._rays = self._rays_here = 0
        self._base = 0.0
        self._rows = self._rows_done = 0
        self._began = time.monotonic()
        self._gained = 0.0

    def begin_stage(self, tasks: Collection[Task], last: bool) -> None:
        """Note the tasks of a stage."""
        if last:
            self._base = min(0.5, self._rays / self._num_rays)
            self._rows = sum(task.stop - task.start for task in tasks)

    def add(self, task: Task, cost: TaskCost, here: bool) -> None:
        """Count a finished task; `here`: in this run, not one before an interruption."""
        before = self.fraction
        self._rays += cost.rays
        if self._rows:
            self._rows_done += task.stop - task.start
        if here:
            self._rays_here += cost.rays
            self._gained += self.fraction - before

    @property
    def fraction(self) -> float:
        """0 to 1; never falls."""
        if self._rows:
            return self._base + (1 - self._base) * self._rows_done / self._rows
        return min(0.5, self._rays / self._num_rays)

    def fields(self) -> dict[str, float | None]:
        """As the ledger keeps them."""
        elapsed_s = max(1e-3, time.monotonic() - self._began)
        left_s = elapsed_s * (1 - self.fraction) / self._gained if self._gained > 0 else None
        rate = self._rays_here / elapsed_s if self._rays_here else None
        return {"progress": self.fraction, "rays_per_second": rate, "seconds_left": left_s}
