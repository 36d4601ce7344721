"""Progress and remaining time of a bake."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from relume.store.bake_protocol import Plan, Task
from relume_worker.status import TaskCost

# Between two finished tasks the progress advances at the rate so far, but at most by this fraction of the next task.
MAX_EXTRAPOLATION = 0.9
# From this fraction on, the remaining time follows from the bake's own rate alone; before, also from other bakes.
FULL_TRUST_FRACTION = 0.08
# Below this fraction there is no estimate of the rest: other bakes were of other scenes.
MIN_ESTIMATE_FRACTION = 0.1


@dataclass(frozen=True)
class ExpectedWork:
    """Expected times of a bake, from finished ones.

    Attributes:
        seconds: total, None if unknown.
        stage_fractions: fractions of the time, by stage, None if unknown.
        parallel: concurrent tasks.
    """

    seconds: float | None = None
    stage_fractions: Sequence[float] | None = None
    parallel: int = 1


class Progress:
    """Fraction done, rate and remaining time of one run of a bake.

    Stages are weighted by their fraction of the time of finished bakes, and tasks within a stage by their rows. If
    there are no finished bakes, earlier stages are weighted by their rays in the plan, and the last one, by far the
    longest, gets the rest; rate and remaining time then refer to the current stage.
    """

    def __init__(
        self,
        plan: Plan,
        initial: float = 0.0,
        expected_work: ExpectedWork | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """
        Args:
            plan: plan of the bake. initial: progress before an interruption. expected_work: from finished bakes.
            clock: monotonic seconds.
        """
        self._clock, self._expected_work = clock, expected_work or ExpectedWork()
        self._num_rays = max(1, plan.num_rays)
        self._rays, self._stage = 0, -1
        self._done = self._base = self._span = 0.0
        self._displayed = initial
        self._total = self._largest = 0
        self._is_measurable = self._is_working = False
        self._parallel = 1
        self._restart()

    def begin_stage(self, tasks: Collection[Task], last: bool) -> None:
        """Set the tasks of a stage."""
        stage_fractions = self._expected_work.stage_fractions
        self._stage += 1
        weights = [_weight(task) for task in tasks]
        self._total, self._largest = sum(weights), max(weights, default=0)
        if stage_fractions is not None:
            self._base, self._span = sum(stage_fractions[: self._stage]), stage_fractions[self._stage]
            self._done = self._base
        elif last:
            self._base, self._span = self._done, 1 - self._done
        else:
            self._span = 0.0
        self._is_measurable = self._span > 0 and self._total > 0
        self._parallel = max(1, min(self._expected_work.parallel, len(tasks)))
        self._num_local, self._task_s, self._stage_began = 0, 0.0, self._clock()
        if stage_fractions is None or not self._gain:
            self._restart()

    def begin_work(self) -> None:
        """Restart the clock: the time so far was preparation, which does not affect the rate."""
        self._is_working = True
        self._restart()

    def _restart(self) -> None:
        self._began = self._last = self._stage_began = self._clock()
        self._local_rays, self._num_local, self._gain, self._task_s = 0, 0, 0.0, 0.0

    def add(self, task: Task, cost: TaskCost, is_local: bool) -> None:
        """Count a finished task.

        Args:
            task: the finished task. cost: seconds and rays.
            is_local: true if it was done in this run, not before an interruption.
        """
        previous = self._done
        self._rays += cost.rays
        if self._is_measurable:
            self._done += self._span * _weight(task) / self._total
        elif self._expected_work.stage_fractions is None:
            self._done = min(0.5, self._rays / self._num_rays)
        if is_local:
            self._local_rays += cost.rays
            self._gain += self._done - previous
            self._task_s += cost.seconds
            self._num_local += 1
            self._is_working = True
            self._last = self._clock()

    def fields(self) -> dict[str, float | None]:
        """Fields for the ledger: monotonic progress 0 to 1, rays per second, and remaining seconds, from a tenth on."""
        since_s, worked_s = self._clock() - self._last, self._last - self._began
        per_second = self._rate()
        if per_second:
            step = MAX_EXTRAPOLATION * self._span * self._largest / max(1, self._total)
            self._displayed = max(self._displayed, min(1.0, self._done + min(step, per_second * since_s)))
        self._displayed = max(self._displayed, self._done)
        return {
            "progress": min(1.0, self._displayed),
            "rays_per_second": self._local_rays / max(1e-3, worked_s) if self._local_rays else None,
            "seconds_left": self._remaining_s(per_second, since_s) if per_second and self._has_estimate else None,
        }

    @property
    def _has_estimate(self) -> bool:
        return self._done >= MIN_ESTIMATE_FRACTION

    def _remaining_s(self, per_second: float, since_s: float) -> float:
        """Remaining seconds at a rate, at least as many as if all running tasks ended now."""
        in_progress = self._span * min(1.0, self._parallel * self._largest / max(1, self._total))
        gain = self._gain + in_progress
        lower_bound = (1 - self._done - in_progress) * (self._clock() - self._began) / gain if gain else 0.0
        return max(0.0, lower_bound, (1 - self._done) / per_second - since_s)

    def _rate(self) -> float | None:
        """Fraction of the bake done per second; None if unknown.

        Finished bakes count less and less as this one advances.
        """
        if not self._is_measurable:
            return None
        observed_rate = self._gain / max(1e-3, self._worked_s()) if self._gain else None
        if not self._expected_work.seconds or not self._is_working:
            return observed_rate
        expected_rate = 1 / self._expected_work.seconds
        if observed_rate is None:
            return expected_rate
        trust = min(1.0, self._gain / FULL_TRUST_FRACTION)
        return math.exp(trust * math.log(observed_rate) + (1 - trust) * math.log(expected_rate))

    def _worked_s(self) -> float:
        """Total seconds of the finished tasks.

        Parallel tasks end together: after the first one, the wall clock would count all their time for a single task.
        """
        wall_s, parallel = self._last - self._stage_began, self._parallel
        finished_s = wall_s * self._num_local / max(1, self._num_local + parallel - 1)
        stage_s = min(wall_s, max(self._task_s / parallel, finished_s))
        return max(0.0, self._stage_began - self._began) + max(0.0, stage_s)


def _weight(task: Task) -> int:
    return max(1, task.stop - task.start)
