"""Progress is monotonic and ends at one; the estimate of the remaining time is accurate for equal tasks."""

from itertools import pairwise

import numpy as np
import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene

from relume.store.bake_protocol import Task
from relume_worker.progress import ExpectedWork, Progress
from relume_worker.status import TaskCost

PLAN = FakeMethod(num_rays=10_000).plan(tiny_scene(), RECIPE)
TASKS = [Task(1, i, "front", i * 10, i * 10 + 10) for i in range(10)]


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def run(seconds: float, done_before: int = 0) -> list[dict[str, float | None]]:
    """Fields after each second; each of ten tasks takes `seconds`, sequentially."""
    clock = Clock()
    progress = Progress(PLAN, clock=clock)
    progress.begin_stage([Task(0, 0, "front", 0, 0)], last=False)
    progress.add(Task(0, 0, "front", 0, 0), TaskCost(1000, 0.1, 0.1), is_local=True)
    progress.begin_stage(TASKS, last=True)
    for task in TASKS[:done_before]:
        progress.add(task, TaskCost(1000, 1, 1), is_local=False)
    fields = []
    for task in TASKS[done_before:]:
        for _ in range(int(seconds)):
            fields.append(progress.fields())
            clock.now += 1
        progress.add(task, TaskCost(1000, 1, 1), is_local=True)
    return [*fields, progress.fields()]


def test_progress_never_falls_and_ends_at_one() -> None:
    values = [fields["progress"] or 0.0 for fields in run(4)]
    assert values == sorted(values)
    assert values[0] == pytest.approx(0.1)
    assert values[-1] == pytest.approx(1.0)
    assert max(after - before for before, after in pairwise(values)) < 0.1


@pytest.mark.parametrize("done_before", [0, 5])
def test_remaining_time_is_accurate(done_before: int) -> None:
    samples = run(4, done_before)
    assert [fields["seconds_left"] for fields in samples[:4]] == [None] * 4
    for elapsed, fields in enumerate(samples[4:], start=4):
        assert fields["seconds_left"] == pytest.approx(len(samples) - 1 - elapsed, abs=1e-6)
        assert fields["rays_per_second"] == pytest.approx(250, rel=0.01)


def test_bake_without_rows_has_progress() -> None:
    progress = Progress(PLAN)
    progress.begin_stage([], last=True)
    assert progress.fields() == {"progress": 0.0, "rays_per_second": None, "seconds_left": None}


def remaining_times(
    true_s: float, prior_s: float | None, parallel: int = 1, num_tasks: int = 100
) -> list[tuple[float, ...]]:
    """Return (fraction done, estimated and actual seconds left) after each task.

    Two stages, with a tenth and nine tenths of the work, on `parallel` processes; task durations differ by up to 10 %.
    """
    clock, random = Clock(), np.random.default_rng(1)
    expected = ExpectedWork(prior_s, (0.1, 0.9), parallel)
    progress = Progress(PLAN, expected_work=expected, clock=clock)
    clock.now += 60.0  # the processes start, and compile
    progress.begin_stage([Task(0, 0, "front", 0, 0)], last=False)
    assert progress.fields()["seconds_left"] is None
    progress.begin_work()
    began, estimates = clock.now, []
    clock.now += 0.1 * true_s
    progress.add(Task(0, 0, "front", 0, 0), TaskCost(1000, 1, 0.1 * true_s * parallel), is_local=True)
    tasks = [Task(1, i, "front", i * 10, i * 10 + 10) for i in range(num_tasks)]
    progress.begin_stage(tasks, last=True)
    mean_s = 0.9 * true_s * parallel / num_tasks
    free, ends = [clock.now] * parallel, []
    for task, seconds in zip(tasks, mean_s * random.uniform(0.9, 1.1, num_tasks), strict=True):
        first = int(np.argmin(free))
        free[first] += seconds
        ends.append((free[first], task, seconds))
    for done, (now, task, seconds) in enumerate(sorted(ends, key=lambda end: end[0]), start=1):
        clock.now = now
        progress.add(task, TaskCost(1000, 1, seconds), is_local=True)
        left = progress.fields()["seconds_left"]
        estimates.append((0.1 + 0.9 * done / num_tasks, left, max(free) - now))
    assert max(free) - began == pytest.approx(true_s, rel=0.1)
    return estimates


@pytest.mark.parametrize("slower", [0.1, 0.3, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("parallel", [1, 2, 8])
@pytest.mark.parametrize("has_prior", [True, False])
def test_first_tenth_of_the_work_predicts_the_rest(slower: float, parallel: int, has_prior: bool) -> None:
    estimates = remaining_times(100.0 * slower, 100.0 if has_prior else None, parallel)
    for done, said, true in estimates:
        if 0.1 < done < 0.95:
            assert said == pytest.approx(true, rel=0.25), done


def expected_alone(prior_s: float | None) -> tuple[Progress, Clock]:
    """A stage of ten tasks that has just begun, without estimates of other bakes."""
    clock = Clock()
    progress = Progress(PLAN, expected_work=ExpectedWork(prior_s, (0.0, 1.0)), clock=clock)
    progress.begin_stage([], last=False)
    progress.begin_stage(TASKS, last=True)
    progress.begin_work()
    return progress, clock


def test_no_estimate_without_evidence() -> None:
    progress, clock = expected_alone(None)
    for _ in range(50):
        assert progress.fields()["seconds_left"] is None
        clock.now += 1


def test_resumed_bake_uses_the_prior_until_it_is_impossible() -> None:
    progress, clock = expected_alone(20.0)
    assert progress.fields()["seconds_left"] is None  # other bakes give no estimate in the first tenth
    progress.add(TASKS[0], TaskCost(1000, 1, 1), is_local=False)
    assert progress.fields()["seconds_left"] == pytest.approx(18.0)
    clock.now += 1
    assert progress.fields()["seconds_left"] == pytest.approx(17.0)
    clock.now += 9  # the next of ten tasks should have ended eight seconds ago
    assert progress.fields()["seconds_left"] >= 80.0


def test_first_tenth_has_no_estimate_despite_a_prior() -> None:
    clock = Clock()
    progress = Progress(PLAN, expected_work=ExpectedWork(3.0, (1.0,)), clock=clock)
    tasks = [Task(0, i, "front", i, i + 1) for i in range(40)]
    progress.begin_stage(tasks, last=True)
    progress.begin_work()
    said = []
    for task in tasks:
        clock.now += 1
        progress.add(task, TaskCost(1000, 1, 1), is_local=True)
        said.append(progress.fields()["seconds_left"])
    assert said[:3] == [None] * 3
    assert said[3:] == [pytest.approx(left) for left in range(36, -1, -1)]


def test_stages_are_weighted_by_their_earlier_time() -> None:
    progress = Progress(PLAN, expected_work=ExpectedWork(10.0, (0.25, 0.75)), clock=Clock())
    tasks = [Task(0, i, "front", 0, 0) for i in range(4)]
    progress.begin_stage(tasks, last=False)
    progress.add(tasks[0], TaskCost(1000, 1, 1), is_local=True)
    assert progress.fields()["progress"] == pytest.approx(0.0625)
    for task in tasks[1:]:
        progress.add(task, TaskCost(1000, 1, 1), is_local=True)
    progress.begin_stage(TASKS, last=True)
    assert progress.fields()["progress"] == pytest.approx(0.25)
    progress.add(TASKS[0], TaskCost(1000, 1, 1), is_local=True)
    assert progress.fields()["progress"] == pytest.approx(0.325)


def test_sequential_stage_counts_with_its_full_time() -> None:
    """One task with a fifth of the work, then twenty tasks on two processes: the first predicts the others."""
    clock = Clock()
    progress = Progress(PLAN, expected_work=ExpectedWork(None, (0.2, 0.8), 2), clock=clock)
    progress.begin_stage([Task(0, 0, "front", 0, 0)], last=False)
    progress.begin_work()
    clock.now += 20
    progress.add(Task(0, 0, "front", 0, 0), TaskCost(0, 0, 20), is_local=True)
    progress.begin_stage([Task(1, i, "front", i * 10, i * 10 + 10) for i in range(20)], last=True)
    assert progress.fields()["seconds_left"] == pytest.approx(80)
