"""How long a bake will take, judged by what finished ones took of their plans, and by how busy the machine is."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from relume.store.bake_protocol import Plan
from relume_worker.executor import is_tiny, num_cores

_MAX_EXTRAPOLATION = 8.0  # times as much work as any that was measured


@dataclass(frozen=True)
class CompletedBake:
    """What a finished bake took.

    Attributes:
        task_s: seconds of its tasks, as if they had run one after another.
        crowding: how many wanted each core at its end.
    """

    plan: Plan
    task_s: float
    crowding: float = 1.0


def machine_load() -> float:
    """How many threads want to run, the mean of the last minute; 0 where the system does not tell."""
    try:
        return os.getloadavg()[0]
    except (OSError, AttributeError):
        return 0.0


def crowding(load: float) -> float:
    """How many of so many threads want each core, at least one: by so much does each of them take longer."""
    return max(1.0, load / num_cores())


def estimate_seconds(
    plan: Plan, completed: Sequence[CompletedBake], num_workers: int, load_factor: float = 1.0
) -> float | None:
    """Wall seconds that a bake will take; None where nothing was measured yet.

    A plan counts rays that are never traced: edges that are not there, lights behind the surface, shadows that are
    predicted. So the rate is that of planned work. Plans of before tell rays alone and judge where there is no other.
    Tiny bakes run one task at a time, others `num_workers`; the others' rate includes their own overhead, so a bake is
    judged by its like where there is one. Of what is far smaller most was overhead: what a bake has more of than they
    had takes as long as its plan says, where they were not faster than that.

    Args:
        plan: of the bake.
        completed: bakes that were measured, of any scenes.
        num_workers: tasks that run at once.
        load_factor: how many will want each core while it runs.
    """
    timed = [bake for bake in completed if bake.plan.work_s] if plan.work_s else []
    completed, get_work = (timed, _work_s) if timed else (completed, _num_rays)
    similar = [bake for bake in completed if is_tiny(bake.plan) == is_tiny(plan)] or completed
    planned_work = sum(get_work(bake.plan) for bake in similar)
    wall_s = sum(bake.task_s / bake.crowding / (1 if is_tiny(bake.plan) else num_workers) for bake in similar)
    if not planned_work or not wall_s:
        return None
    work, max_work = get_work(plan), max(map(get_work, (bake.plan for bake in similar)))
    if get_work is _num_rays or work <= _MAX_EXTRAPOLATION * max_work:
        return load_factor * work * wall_s / planned_work
    extra_rate = min(wall_s / planned_work, 1 / (1 if is_tiny(plan) else num_workers))
    return load_factor * (wall_s / len(similar) + (work - planned_work / len(similar)) * extra_rate)


def _work_s(plan: Plan) -> float:
    return plan.work_s


def _num_rays(plan: Plan) -> float:
    return plan.num_rays
