"""How long a bake will take, judged by what finished ones took of their plans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from relume.transfer.base import Plan
from worker.executor import is_tiny


@dataclass(frozen=True)
class Finished:
    """What a finished bake took.

    Attributes:
        task_s: seconds of its tasks, as if they had run one after another.
    """

    plan: Plan
    task_s: float


def seconds_for(plan: Plan, finished: Sequence[Finished], num_workers: int) -> float | None:
    """Wall seconds that a bake will take; None where nothing was measured yet.

    A plan counts rays that are never traced: edges that are not there, lights behind the surface, shadows that are
    predicted. So the rate is that of planned rays. Tiny bakes run one task at a time, others `num_workers`; the others'
    rate includes their own overhead, so a bake is judged by its like where there is one.
    """
    alike = [each for each in finished if is_tiny(each.plan) == is_tiny(plan)] or finished
    planned_rays = sum(each.plan.num_rays for each in alike)
    wall_s = sum(each.task_s / (1 if is_tiny(each.plan) else num_workers) for each in alike)
    return plan.num_rays * wall_s / planned_rays if planned_rays and wall_s else None
