"""How far a bake is, and how long it still takes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from relume.store.bake_protocol import Plan, Task
from relume_worker.status import TaskCost

# Between two finished tasks the bar moves on at the rate so far, but never past this part of the next task.
MAX_EXTRAPOLATION = 0.9
# Once so much of a bake is done, its time left follows from its own rate alone; before, also from what others took.
FULL_TRUST_FRACTION = 0.08
# Before so much of a bake is done, nobody can say how long the rest takes: others' bakes were of other scenes.
MIN_ESTIMATE_FRACTION = 0.1


@dataclass(frozen=True)
class ExpectedWork:
    """What finished bakes tell of one that begins.

    Attributes:
        seconds: that it will take, None where nothing is known.
        stage_fractions: of each stage in its time, None where that is not known.
        parallel: tasks that run at once.
    """

    seconds: float | None = None
    stage_fractions: Sequence[float] | None = None
    parallel: int = 1


class Progress:
    """Fraction done, rate and time left of one run of a bake.

    Stages count by their share of the time of finished bakes, and within a stage tasks by their rows. Where no bake has
    ended yet, earlier stages count by their rays against the plan's, and the last one, by far the longest, has what is
    left; rate and time left are then those of the stage that runs.
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
            initial: what people have seen already, before an interruption.
            clock: seconds.
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
        """Note the tasks of a stage."""
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
        """Tasks begin only now: the time so far was spent on getting ready, and tells nothing of their rate."""
        self._is_working = True
        self._restart()

    def _restart(self) -> None:
        self._began = self._last = self._stage_began = self._clock()
        self._local_rays, self._num_local, self._gain, self._task_s = 0, 0, 0.0, 0.0

    def add(self, task: Task, cost: TaskCost, is_local: bool) -> None:
        """Count a finished task.

        Args:
            task: that is done. cost: seconds and rays of it.
            is_local: it was done in this run, not in one before an interruption.
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
        """As the ledger keeps them: progress from 0 to 1 that never falls, rays per second, and seconds left, once a
        tenth of the bake is done."""
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
        """At a rate; but at least as many as where all tasks in hand ended just now."""
        in_progress = self._span * min(1.0, self._parallel * self._largest / max(1, self._total))
        gain = self._gain + in_progress
        lower_bound = (1 - self._done - in_progress) * (self._clock() - self._began) / gain if gain else 0.0
        return max(0.0, lower_bound, (1 - self._done) / per_second - since_s)

    def _rate(self) -> float | None:
        """Share of the bake that is done in a second; None where nothing tells.

        What finished bakes took counts less and less as this one goes on.
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
        """Seconds that the finished tasks took, all together.

        Tasks that run side by side end together: when the first of them has ended, the wall clock would count the time
        of all for one alone.
        """
        wall_s, parallel = self._last - self._stage_began, self._parallel
        finished_s = wall_s * self._num_local / max(1, self._num_local + parallel - 1)
        stage_s = min(wall_s, max(self._task_s / parallel, finished_s))
        return max(0.0, self._stage_began - self._began) + max(0.0, stage_s)


def _weight(task: Task) -> int:
    return max(1, task.stop - task.start)
