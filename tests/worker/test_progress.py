"""Progress never falls, ends at one, and the time left comes true when tasks take as long as those before."""

from itertools import pairwise

import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene

from relume.transfer.base import Task
from worker.progress import Progress
from worker.status import TaskCost

PLAN = FakeMethod(num_rays=10_000).plan(tiny_scene(), RECIPE)
TASKS = [Task(1, i, "front", i * 10, i * 10 + 10) for i in range(10)]


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def run(seconds: float, done_before: int = 0) -> list[dict[str, float | None]]:
    """Fields after each second; each of ten tasks takes `seconds`, one at a time."""
    clock = Clock()
    progress = Progress(PLAN, clock=clock)
    progress.begin_stage([Task(0, 0, "front", 0, 0)], last=False)
    progress.add(Task(0, 0, "front", 0, 0), TaskCost(1000, 0.1, 0.1), here=True)
    progress.begin_stage(TASKS, last=True)
    for task in TASKS[:done_before]:
        progress.add(task, TaskCost(1000, 1, 1), here=False)
    seen = []
    for task in TASKS[done_before:]:
        for _ in range(int(seconds)):
            seen.append(progress.fields())
            clock.now += 1
        progress.add(task, TaskCost(1000, 1, 1), here=True)
    return [*seen, progress.fields()]


def test_progress_never_falls_and_ends_at_one() -> None:
    values = [fields["progress"] or 0.0 for fields in run(4)]
    assert values == sorted(values)
    assert values[0] == pytest.approx(0.1)
    assert values[-1] == pytest.approx(1.0)
    assert max(after - before for before, after in pairwise(values)) < 0.1


@pytest.mark.parametrize("done_before", [0, 5])
def test_time_left_comes_true(done_before: int) -> None:
    seen = run(4, done_before)
    assert [fields["seconds_left"] for fields in seen[:4]] == [None] * 4
    for elapsed, fields in enumerate(seen[4:], start=4):
        assert fields["seconds_left"] == pytest.approx(len(seen) - 1 - elapsed, abs=1e-6)
        assert fields["rays_per_second"] == pytest.approx(250, rel=0.01)


def test_bake_without_rows_has_progress() -> None:
    progress = Progress(PLAN)
    progress.begin_stage([], last=True)
    assert progress.fields() == {"progress": 0.0, "rays_per_second": None, "seconds_left": None}
