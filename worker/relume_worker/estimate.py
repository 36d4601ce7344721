"""Estimate the time of a bake from finished bakes, their plans, and the load of the machine."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from relume.store.bake_protocol import Plan
from relume_worker.executor import is_tiny, num_cores

_MAX_EXTRAPOLATION = 8.0  # largest work of a bake, relative to the largest measured one


@dataclass(frozen=True)
class CompletedBake:
    """Measured work of a finished bake.

    Attributes:
        task_s: total seconds of its tasks, as if run one after another.
        crowding: threads per core at its end.
    """

    plan: Plan
    task_s: float
    crowding: float = 1.0


def machine_load() -> float:
    """Runnable threads, mean of the last minute; 0 if the system does not report it."""
    try:
        return os.getloadavg()[0]
    except (OSError, AttributeError):
        return 0.0


def crowding(load: float) -> float:
    """Threads per core, at least one: the factor by which each of them slows down."""
    return max(1.0, load / num_cores())


def estimate_seconds(
    plan: Plan, completed: Sequence[CompletedBake], num_workers: int, load_factor: float = 1.0
) -> float | None:
    """Estimate the wall time of a bake; None if nothing has been measured yet.

    A plan counts rays that are never traced: missing edges, lights behind the surface, predicted shadows. So the rate
    is that of planned work. Older plans have rays only, and are used if there are no others. Tiny bakes run one task at
    a time, others `num_workers`; their rate includes overhead, so a bake is estimated from similar ones if there are
    any. Much smaller bakes are mostly overhead: additional work takes the planned time, unless they were faster.

    Args:
        plan: plan of the bake.
        completed: measured bakes of any scenes.
        num_workers: concurrent tasks.
        load_factor: expected threads per core.
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
