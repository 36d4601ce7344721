"""Steps in worker processes: results, errors, progress, killed processes, cancellation."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Future
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from tiny_scenes import still_life

from relume.core.errors import CancelledError, NotFoundError, RelumeError, StoreError, StoreNotFoundError
from relume.store.bake_protocol import Recipe
from relume_server.batch.cluster_steps import ClusterSteps
from relume_server.batch.worker_process import ProcessSettings
from relume_worker.executor import BULK, URGENT, Executors
from relume_worker.jobs.claim import claim, is_claimed_by
from relume_worker.jobs.step import Step
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

Outcome = Callable[[Step, Path], Mapping[str, Any] | None]


class Workers:
    """Stand-in for the executors: each submitted step ends with the next outcome; None: never."""

    def __init__(self, *outcomes: Outcome) -> None:
        self._outcomes = list(outcomes)
        self.slots: list[str] = []
        self.num_users = 0

    @contextmanager
    def keep_cluster(self) -> Iterator[None]:
        self.num_users += 1
        yield
        self.num_users -= 1

    def num_processes(self) -> int:
        return 1

    def cluster(self, slot: str) -> Any:
        assert self.num_users > 0
        self.slots.append(slot)
        return SimpleNamespace(submit=self._submit)

    def _submit(self, fn: object, process: object, step: Step, progress_file: str) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            if (result := self._outcomes.pop(0)(step, Path(progress_file))) is not None:
                future.set_result(result)
        except Exception as error:
            future.set_exception(error)
        return future


def steps_with(tmp_path: Path, *outcomes: Outcome) -> tuple[ClusterSteps, Workers]:
    workers = Workers(*outcomes)
    process = ProcessSettings(str(tmp_path), 1 << 20, (), 1, 1)
    return ClusterSteps(cast("Executors", workers), process, {}), workers


def answers(step: Step, progress_file: Path) -> Mapping[str, Any]:
    return {"answer": {"kind": step.kind}}


def dies(step: Step, progress_file: Path) -> Mapping[str, Any]:
    raise BrokenExecutor


def hangs(step: Step, progress_file: Path) -> None:
    progress_file.write_text("0.5")


def ignore(fraction: float) -> None:
    pass


def test_urgent_steps_take_urgent_places_and_claims_are_removed(tmp_path: Path) -> None:
    def checks_claim(step: Step, progress_file: Path) -> Mapping[str, Any]:
        assert step.claim is not None
        assert is_claimed_by(Path(step.claim[0]), step.claim[1])
        return answers(step, progress_file)

    steps, workers = steps_with(tmp_path, checks_claim, checks_claim)
    for is_first in (True, False):
        assert steps.run(Step("work", is_first), ignore, lambda: True) == {"kind": "work"}
    assert workers.slots == [URGENT, BULK]
    assert list((tmp_path / "steps").iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("internal", RelumeError),
        ("store-not-found", StoreNotFoundError),
        ("store", StoreError),
        ("not-found", NotFoundError),
    ],
)
def test_errors_of_the_process_are_raised_here(tmp_path: Path, kind: str, expected: type[Exception]) -> None:
    steps, _ = steps_with(tmp_path, lambda step, file: {"problem": "no.", "kind": kind})
    with pytest.raises(RelumeError, match=r"^no\.$") as raised:
        steps.run(Step("work"), ignore, lambda: True)
    assert raised.type is expected


def test_step_of_a_killed_process_runs_again_once(tmp_path: Path) -> None:
    steps, _ = steps_with(tmp_path, dies, answers, dies, dies)
    assert steps.run(Step("work"), ignore, lambda: True) == {"kind": "work"}
    with pytest.raises(RelumeError, match=r"process of the work was killed twice.*; give a smaller size"):
        steps.run(Step("work"), ignore, lambda: True)


def test_progress_is_reported_and_waiting_ends_when_not_needed(tmp_path: Path) -> None:
    steps, _ = steps_with(tmp_path, hangs)
    folder, fractions = tmp_path / "job", list[float]()
    folder.mkdir()
    claim(folder, "here")
    with pytest.raises(CancelledError, match="the work was stopped"):
        steps.run(Step("work", claim=(str(folder), "here")), fractions.append, lambda: not fractions)
    assert fractions == [0.5]
    assert [path.name for path in folder.iterdir()] == ["claim.txt"]  # no progress is left


def test_closing_ends_all_waiting(tmp_path: Path) -> None:
    steps, _ = steps_with(tmp_path, hangs)
    steps.close()
    with pytest.raises(CancelledError):
        steps.run(Step("work", is_first=True), ignore, lambda: True)


@pytest.mark.slow
def test_worker_process_paints_a_thumbnail_and_reports_errors(tmp_path: Path) -> None:
    with BakeService(tmp_path, num_workers=1) as service:
        scene = register_scene(tmp_path, service.ledger, still_life())
        bake = service.submit(scene, Recipe("direct", ("front",), (24, 16), 40))
        with service.subscribe(bake) as changes:
            assert list(changes)[-1].state == "ready"
        process = ProcessSettings(str(tmp_path), 1 << 28, (), 1 << 30, 60)
        with closing(ClusterSteps(service.executors, process, {})) as steps:
            for is_first in (True, False):
                path = tmp_path / f"{is_first}.webp"
                steps.run(
                    Step("thumbnail of a bake", is_first, {"bake": bake, "path": str(path)}), ignore, lambda: True
                )
                assert path.stat().st_size > 0
            path = tmp_path / "none.webp"
            with pytest.raises(StoreError, match="0000"):
                steps.run(
                    Step("thumbnail of a bake", True, {"bake": "0" * 16, "path": str(path)}), ignore, lambda: True
                )
