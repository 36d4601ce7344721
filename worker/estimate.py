"""How long a bake will take, judged by what finished ones took of their plans, and by how busy the machine is."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from relume.bake import Plan
from worker.executor import is_tiny, num_cores

_FAR = 8.0  # times as much work as any that was measured


@dataclass(frozen=True)
class Finished:
    """What a finished bake took.

    Attributes:
        task_s: seconds of its tasks, as if they had run one after another.
        crowding: how many wanted each core at its end.
    """

    plan: Plan
    task_s: float
    crowding: float = 1.0


def load_of_machine() -> float:
    """How many threads want to run, the mean of the last minute; 0 where the system does not tell."""
    try:
        return os.getloadavg()[0]
    except (OSError, AttributeError):
        return 0.0


def crowding(load: float) -> float:
    """How many of so many threads want each core, at least one: by so much does each of them take longer."""
    return max(1.0, load / num_cores())


def seconds_for(plan: Plan, finished: Sequence[Finished], num_workers: int, crowded: float = 1.0) -> float | None:
    """Wall seconds that a bake will take; None where nothing was measured yet.

    A plan counts rays that are never traced: edges that are not there, lights behind the surface, shadows that are
    predicted. So the rate is that of planned work. Plans of before tell rays alone and judge where there is no other.
    Tiny bakes run one task at a time, others `num_workers`; the others' rate includes their own overhead, so a bake is
    judged by its like where there is one. Of what is far smaller most was overhead: what a bake has more of than they
    had takes as long as its plan says, where they were not faster than that.

    Args:
        plan: of the bake.
        finished: bakes that were measured, of any scenes.
        num_workers: tasks that run at once.
        crowded: how many will want each core while it runs.
    """
    others = [each for each in finished if each.plan.work_s] if plan.work_s else []
    finished, work_of = (others, _work_s) if others else (finished, _num_rays)
    alike = [each for each in finished if is_tiny(each.plan) == is_tiny(plan)] or finished
    planned = sum(work_of(each.plan) for each in alike)
    wall_s = sum(each.task_s / each.crowding / (1 if is_tiny(each.plan) else num_workers) for each in alike)
    if not planned or not wall_s:
        return None
    work, most = work_of(plan), max(map(work_of, (each.plan for each in alike)))
    if work_of is _num_rays or work <= _FAR * most:
        return crowded * work * wall_s / planned
    beyond = min(wall_s / planned, 1 / (1 if is_tiny(plan) else num_workers))
    return crowded * (wall_s / len(alike) + (work - planned / len(alike)) * beyond)


def _work_s(plan: Plan) -> float:
    return plan.work_s


def _num_rays(plan: Plan) -> float:
    return plan.num_rays
