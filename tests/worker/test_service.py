"""Bakes through the service in this process with a fast method: progress, cancellation, resume, rejection, damage."""

import hashlib
import re
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene
from sqlalchemy import update

from relume.core.errors import (
    BudgetError,
    DiskBudgetError,
    DiskFullError,
    MemoryBudgetError,
    NotFoundError,
    ParameterError,
)
from relume.store.bake_protocol import Plan, Task
from relume.store.reader import open_store
from relume.store.run_bake import bake_in_process
from relume_worker import lease, scenes
from relume_worker.bake_kind import START_S
from relume_worker.database.models import JobRow
from relume_worker.executor import TINY_BAKE_RAYS, Executors
from relume_worker.jobs.job import UNREADABLE
from relume_worker.ledger import Ledger
from relume_worker.paths import staging_path
from relume_worker.scenes import delete_bakes, delete_scene, register_scene
from relume_worker.service import BakeService
from relume_worker.status import BakeStatus, TaskCost, bake_id
from relume_worker.tasks import BakeInput, run_task

SCENE = tiny_scene()
NUM_TASKS = 2 + 2 * 9


def open_service(data_dir: Path, **method: Any) -> BakeService:
    service = BakeService(data_dir, methods={"fake": FakeMethod(**method)})
    register_scene(service.data_dir, service.ledger, SCENE)
    return service


def follow(service: BakeService, identity: str) -> BakeStatus:
    with service.subscribe(identity) as changes:
        return list(changes)[-1]


def tree_hash(folder: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
        digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Hash of the store of an undisturbed bake."""
    return tree_hash(bake_in_process(FakeMethod(), SCENE, RECIPE, tmp_path_factory.mktemp("expected") / "s.zarr"))


def test_bake_is_followed_to_the_end_and_published(tmp_path: Path, expected: str) -> None:
    with open_service(tmp_path) as service:
        identity = service.submit(SCENE.id, RECIPE)
        with service.subscribe(identity) as changes:
            statuses = list(changes)
        assert statuses[-1].state == "ready"
        assert statuses[-1].progress == 1.0
        assert statuses[-1].bytes == sum(
            f.stat().st_size for f in service.store_path(identity).rglob("*") if f.is_file()
        )
        assert [s.progress for s in statuses] == sorted(s.progress for s in statuses)
        assert tree_hash(service.store_path(identity)) == expected
        assert service.submit(SCENE.id, RECIPE) == identity
        assert service.get(identity).state == "ready"


def test_duration_is_estimated_after_the_first_bake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("runner", "bake_kind"):
        monkeypatch.setattr(f"relume_worker.{module}.machine_load", lambda: 0.0)
    with open_service(tmp_path) as service:
        plan = service.plan(SCENE.id, RECIPE)
        assert service.estimate_seconds(plan) is None
        identity = follow(service, service.submit(SCENE.id, RECIPE)).id
        tasks = service.ledger.finished_tasks(identity).values()
        assert service.estimate_seconds(plan) == pytest.approx(sum(cost.seconds for cost in tasks))
        assert not list((tmp_path / "bakes" / "staging").iterdir())


def test_canceled_bake_resumes_without_repeating_finished_tasks(tmp_path: Path, expected: str) -> None:
    log = tmp_path / "log"
    with open_service(tmp_path, delay_s=0.02, log=str(log)) as service:
        identity = service.submit(SCENE.id, RECIPE)
        with service.subscribe(identity) as changes:
            for status in changes:
                if status.progress > 0.3:
                    service.cancel(identity)
        assert status.state == "canceled"
        assert not service.store_path(identity).exists()
        service.submit(SCENE.id, RECIPE)
        assert follow(service, identity).state == "ready"
        assert tree_hash(service.store_path(identity)) == expected
    assert sorted(log.read_text().split()) == sorted(set(log.read_text().split()))
    assert len(log.read_text().split()) == NUM_TASKS


STAGES = {
    "claimed": "relume_worker.bake_kind.BakeKind._expect_work",
    "started": "relume_worker.runner.start_run",
    "prepared": "relume_worker.runner.run_bake.create_stage",
    "task done": "relume_worker.ledger.Ledger.finish_task",
    "all tasks done": "relume_worker.runner.publish",
    "published": "relume_worker.runner.delete_partial",
}


@pytest.mark.parametrize("stage", ["queued", *STAGES])
def test_bake_is_canceled_at_any_stage_and_resumes(
    tmp_path: Path, expected: str, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    service = open_service(tmp_path)
    identity = service.submit(SCENE.id, RECIPE)

    def ended() -> bool:
        return service.get(identity).state == "canceled" and not service.jobs._runs

    def cancel_first(*arguments: Any, **options: Any) -> Any:
        service.cancel(identity)
        return call(*arguments, **options)

    if stage == "queued":
        service.cancel(identity)
    else:
        call = resolve_name(STAGES[stage])
        monkeypatch.setattr(STAGES[stage], cancel_first)
    with service:
        deadline = time.monotonic() + 60
        while not ended():
            assert time.monotonic() < deadline
            time.sleep(0.01)
        monkeypatch.undo()
        assert service.ledger.get("bake", identity).owner is None
        service.submit(SCENE.id, RECIPE)
        assert follow(service, identity).state == "ready"
        assert tree_hash(service.store_path(identity)) == expected


def test_bake_with_a_damaged_recipe_fails_and_others_run(tmp_path: Path) -> None:
    service = open_service(tmp_path)
    damaged, intact = service.submit(SCENE.id, RECIPE), service.submit(SCENE.id, replace(RECIPE, num_lights=3))
    with service.ledger.sessions.begin() as session:
        session.execute(update(JobRow).where(JobRow.id == damaged).values(request="{"))
    with service:
        assert follow(service, intact).state == "ready"
        assert [(bake.id, bake.state) for bake in service.bakes()] == [(intact, "ready"), (damaged, "failed")]
        assert service.get(damaged).problem == UNREADABLE
        assert service.submit(SCENE.id, RECIPE) == damaged
        assert follow(service, damaged).state == "ready"


def stop_half_way(service: BakeService) -> str:
    identity = service.submit(SCENE.id, RECIPE)
    with service.subscribe(identity) as changes:
        for status in changes:
            if status.progress > 0.3:
                service.cancel(identity)
    return identity


def test_partial_data_of_a_stopped_bake_is_kept_for_a_week(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_service(tmp_path, delay_s=0.02) as service:
        identity = stop_half_way(service)
    service = open_service(tmp_path)
    service._delete_orphans()
    assert staging_path(tmp_path, identity).exists()
    assert service.ledger.finished_tasks(identity)
    monkeypatch.setattr("relume_worker.service.STOPPED_RETENTION_S", -1.0)
    service._delete_orphans()
    assert not list((tmp_path / "bakes" / "staging").iterdir())
    assert service.ledger.finished_tasks(identity) == {}
    assert service.get(identity).progress == 0.0
    service.close()


def test_stopped_bake_is_deleted_with_its_partial_data(tmp_path: Path) -> None:
    with open_service(tmp_path, delay_s=0.02) as service:
        identity = stop_half_way(service)
    service = open_service(tmp_path)  # none of its tasks is running
    service.delete(identity)
    assert service.bakes() == []
    assert not list((tmp_path / "bakes" / "staging").iterdir())
    service.close()


def test_stores_are_deleted_if_the_ledger_has_no_disk_space(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_service(tmp_path) as service:
        identity = follow(service, service.submit(SCENE.id, RECIPE)).id
        store, cancel = service.store_path(identity), service.ledger.cancel

        def cancel_where_there_is_room(identity: str) -> bool:
            if store.exists():
                raise DiskFullError("the database")
            return cancel(identity)

        monkeypatch.setattr(service.ledger, "cancel", cancel_where_there_is_room)
        delete_scene(service.data_dir, service.ledger, SCENE.id)
        assert service.bakes() == []
        assert not store.exists()


def test_bake_leaves_disk_space_for_the_ledger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_service(tmp_path) as service:
        with monkeypatch.context() as patch:
            patch.setattr("relume.store.disk_space.RESERVE_BYTES", 1 << 60)
            patch.setattr("relume_worker.service.check_budget", lambda *_: None)
            status = follow(service, service.submit(SCENE.id, RECIPE))
            assert (status.state, (status.problem or "")[:9]) == ("failed", "disk full")
        assert follow(service, service.submit(SCENE.id, RECIPE)).state == "ready"


def test_closed_service_leaves_the_bake_to_the_next_start(tmp_path: Path, expected: str) -> None:
    with open_service(tmp_path, delay_s=0.05) as service:
        identity = service.submit(SCENE.id, RECIPE)
        with service.subscribe(identity) as changes:
            while (status := changes.get()) and status.progress < 0.3:
                pass
    with open_service(tmp_path) as service:
        assert follow(service, identity).state == "ready"
        assert tree_hash(service.store_path(identity)) == expected


@pytest.mark.parametrize(
    ("problem", "sentence"),
    [("disk full", "disk full; free .* MB, then bake again; finished tasks are saved"), ("memory", "out of memory")],
)
def test_failure_is_one_sentence_and_a_retry_finishes(
    tmp_path: Path, expected: str, problem: str, sentence: str
) -> None:
    with open_service(tmp_path, problem=problem) as service:
        identity = service.submit(SCENE.id, RECIPE)
        status = follow(service, identity)
        assert status.state == "failed"
        assert status.problem is not None
        assert len(status.problem.splitlines()) == 1
        assert re.match(sentence, status.problem)
        assert not service.store_path(identity).exists()
    with open_service(tmp_path) as service:
        service.submit(SCENE.id, RECIPE)
        assert follow(service, identity).state == "ready"
        assert tree_hash(service.store_path(identity)) == expected


def test_failing_lane_is_logged_once_while_the_other_continues(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("relume_worker.jobs.job_service.POLL_INTERVAL_S", 0.02)
    tried, tries = threading.Event(), []
    service = open_service(tmp_path)
    claim, large = service.ledger.claim, service.ledger.submit(SCENE.id, RECIPE, Plan(1, TINY_BAKE_RAYS + 1, 1, 1))

    def fails(identity: str) -> bool:
        if identity != large:
            return claim(identity)
        tries.append(identity)
        if len(tries) > 5:
            tried.set()
        raise DiskFullError("the database")

    monkeypatch.setattr(service.ledger, "claim", fails)
    with service:
        small = service.submit(SCENE.id, type(RECIPE)("fake", ("front",), (8, 8), 3))
        assert follow(service, small).state == "ready"
        assert tried.wait(60)
    assert caplog.text.count("trying again") == 1
    assert "resolved" not in caplog.text


def test_bake_that_the_ledger_cannot_record_reports_why_it_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_worker.jobs.job_service.POLL_INTERVAL_S", 0.02)
    service, has_room = open_service(tmp_path), threading.Event()
    claim = service.ledger.claim

    def claims(*arguments: Any) -> bool:
        if not has_room.is_set():
            raise DiskFullError("the database")
        return claim(*arguments)

    monkeypatch.setattr(service.ledger, "claim", claims)
    with service, service.subscribe(service.submit(SCENE.id, RECIPE)) as changes:
        waiting = next(status for status in changes if status.problem)
        assert "disk is full" in (waiting.problem or "")
        assert "resumes by itself" in (waiting.problem or "")
        assert service.bakes() == [waiting]
        has_room.set()
        assert list(changes)[-1].state == "ready"
        assert service.bakes()[0].problem is None


def test_defect_of_a_method_is_reported_and_the_service_continues(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with open_service(tmp_path, problem="defect") as service:
        status = follow(service, service.submit(SCENE.id, RECIPE))
        assert status.state == "failed"
        assert "ZeroDivisionError: one over nothing" in (status.problem or "")
        assert "Traceback" in caplog.text
        smaller = type(RECIPE)("fake", ("front",), (8, 8), 3)
        assert follow(service, service.submit(SCENE.id, smaller)).state == "ready"


def test_plan_over_the_budget_is_rejected_before_any_computation(tmp_path: Path) -> None:
    error_of_field: dict[str, type[BudgetError]] = {"peak_bytes": MemoryBudgetError, "store_bytes": DiskBudgetError}
    for cost, refusal in error_of_field.items():
        with open_service(tmp_path, **{cost: 1 << 60}) as service:
            with pytest.raises(refusal, match="fewer lights"):
                service.plan(SCENE.id, RECIPE)
            with pytest.raises(refusal):
                service.submit(SCENE.id, RECIPE)
            assert service.bakes() == []


def test_memory_of_single_process_steps_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_worker.budget.available_bytes", lambda: 10 << 30)
    monkeypatch.setattr("relume_worker.service.is_tiny", lambda plan: False)
    alone = 5 << 30
    with open_service(tmp_path, peak_bytes=alone, lone_bytes=alone - 1000) as service:
        assert service.plan(SCENE.id, RECIPE).peak_bytes == alone
    with open_service(tmp_path, peak_bytes=alone) as service, pytest.raises(MemoryBudgetError, match="fewer triangles"):
        service.plan(SCENE.id, RECIPE)


def test_process_start_is_part_of_the_estimate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_service(tmp_path) as service:
        follow(service, service.submit(SCENE.id, RECIPE))
        plan = service.plan(SCENE.id, RECIPE)
        warm_s = service.estimate_seconds(plan)
        monkeypatch.setattr("relume_worker.bake_kind.is_tiny", lambda plan: False)
        cold_s = service.estimate_seconds(plan)
        monkeypatch.setattr(Executors, "has_cluster", True)
        assert service.estimate_seconds(plan) == warm_s
    assert warm_s is not None
    assert cold_s == pytest.approx(warm_s + START_S)


def test_worker_processes_are_not_idle_while_they_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    users: list[int] = []
    service = open_service(tmp_path)

    def cluster() -> ThreadPoolExecutor:
        users.append(service.executors._num_users)
        return threads

    monkeypatch.setattr(service.executors, "cluster", cluster)
    with ThreadPoolExecutor(1) as threads, service:
        large = service.ledger.submit(SCENE.id, RECIPE, Plan(1, TINY_BAKE_RAYS + 1, 1, 1))
        assert follow(service, large).state == "ready"
    assert users == [1]
    assert service.executors._num_users == 0


def test_unknown_names_are_rejected(tmp_path: Path) -> None:
    with open_service(tmp_path) as service:
        with pytest.raises(ParameterError, match="fake"):
            service.plan(SCENE.id, type(RECIPE)("magic", ("front",), (8, 8), 3))
        for scene_id in ("0" * 16, "../x"):
            with pytest.raises(NotFoundError):
                service.submit(scene_id, RECIPE)
        for call in (service.get, service.cancel, service.subscribe):
            with pytest.raises(NotFoundError):
                call("0" * 16)


def test_damaged_store_is_baked_again(tmp_path: Path, expected: str) -> None:
    with open_service(tmp_path) as service:
        identity = service.submit(SCENE.id, RECIPE)
        follow(service, identity)
        (service.store_path(identity) / "views/0/visibility/c/0/0").write_bytes(b"")
        assert service.submit(SCENE.id, RECIPE) == identity
        assert follow(service, identity).state == "ready"
        assert tree_hash(service.store_path(identity)) == expected


def test_shard_damaged_before_publication_fails_the_bake_and_the_next_restarts(tmp_path: Path, expected: str) -> None:
    with open_service(tmp_path, problem="disk full") as service:
        identity = service.submit(SCENE.id, RECIPE)
        follow(service, identity)
    shard = next((tmp_path / "bakes" / "staging").glob("*.zarr/views/0/visibility/c/0/0"))
    shard.write_bytes(b"x" * shard.stat().st_size)
    with open_service(tmp_path) as service:
        service.submit(SCENE.id, RECIPE)
        status = follow(service, identity)
        assert status.state == "failed"
        assert "damaged" in (status.problem or "")
        service.submit(SCENE.id, RECIPE)
        assert follow(service, identity).state == "ready"
        assert tree_hash(service.store_path(identity)) == expected


def test_lost_staging_store_restarts_the_bake(tmp_path: Path, expected: str) -> None:
    with open_service(tmp_path, problem="disk full") as service:
        identity = service.submit(SCENE.id, RECIPE)
        follow(service, identity)
    (tmp_path / "bakes" / "staging" / f"{identity}.zarr").rename(tmp_path / "elsewhere")
    with open_service(tmp_path) as service:
        service.submit(SCENE.id, RECIPE)
        assert follow(service, identity).state == "ready"
        assert tree_hash(service.store_path(identity)) == expected


def test_two_services_share_one_bake(tmp_path: Path, expected: str) -> None:
    log = tmp_path / "log"
    with (
        open_service(tmp_path, delay_s=0.01, log=str(log)) as first,
        open_service(tmp_path, delay_s=0.01, log=str(log)) as second,
    ):
        identity = first.submit(SCENE.id, RECIPE)
        assert second.submit(SCENE.id, RECIPE) == identity
        assert follow(second, identity).state == follow(first, identity).state == "ready"
    assert len(log.read_text().split()) == NUM_TASKS
    assert tree_hash(first.store_path(identity)) == expected


def test_scene_deleted_during_its_bake_ends_it(tmp_path: Path) -> None:
    with open_service(tmp_path, delay_s=0.05) as service:
        identity = service.submit(SCENE.id, RECIPE)
        with service.subscribe(identity) as changes:
            while (status := changes.get()) and status.progress < 0.2:
                pass
            delete_scene(service.data_dir, service.ledger, SCENE.id)
            assert list(changes)[-1:] in ([], [changes.latest])
        register_scene(service.data_dir, service.ledger, SCENE)
        assert follow(service, service.submit(SCENE.id, RECIPE)).state == "ready"


def test_bake_taken_over_by_another_process_is_left_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    has_begun, may_go_on = threading.Event(), threading.Event()

    def stall(job: BakeInput, task: Task) -> TaskCost:
        has_begun.set()
        assert may_go_on.wait(30)
        return run_task(job, task)

    monkeypatch.setattr("relume_worker.runner.run_task", stall)
    with open_service(tmp_path) as service:
        identity = service.submit(SCENE.id, RECIPE)
        assert has_begun.wait(30)
        elsewhere = JobRow.__table__.update().values(owner="elsewhere/1/nonce/0", heartbeat=time.time() + 600)
        with service.ledger.sessions.begin() as session:
            session.execute(elsewhere)
        may_go_on.set()
        deadline = time.monotonic() + 30
        while "was taken over by another process" not in caplog.text:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        status = service.get(identity)
        assert (status.state, status.problem) == ("running", None)
        assert service.ledger.finished_tasks(identity) == {}
        assert staging_path(service.data_dir, identity).exists()
        assert not service.store_path(identity).exists()


def test_bake_deleted_at_the_end_of_a_task_is_not_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    finish, deleted = Ledger.finish_task, threading.Event()

    def finish_deleted(ledger: Ledger, identity: str, *arguments: Any) -> bool:
        ledger.delete([identity])
        deleted.set()
        return finish(ledger, identity, *arguments)

    monkeypatch.setattr(Ledger, "finish_task", finish_deleted)
    with open_service(tmp_path) as service:
        service.submit(SCENE.id, RECIPE)
        assert deleted.wait(30)
    assert [record.message for record in caplog.records if "failed" in record.message] == []


def test_folder_that_a_task_writes_after_its_bake_was_deleted_is_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_written = threading.Event()

    def write_deleted(job: BakeInput, task: Task) -> TaskCost:
        delete_bakes(service.data_dir, service.ledger, [job.bake_id])
        (tmp_path / "bakes" / "staging" / f"{job.bake_id}.zarr" / "views").mkdir(parents=True)
        is_written.set()
        raise KeyError("lights/irradiance")

    monkeypatch.setattr("relume_worker.runner.run_task", write_deleted)
    with open_service(tmp_path) as service:
        service.submit(SCENE.id, RECIPE)
        assert is_written.wait(30)
    assert list((tmp_path / "bakes" / "staging").iterdir()) == []


def test_bake_deleted_during_a_task_is_not_a_defect(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    met = threading.Event()

    def run_deleted(job: BakeInput, task: Task) -> TaskCost:
        delete_bakes(service.data_dir, service.ledger, [job.bake_id])
        met.set()
        raise KeyError("lights/irradiance")  # zarr's error for an array without its folder

    monkeypatch.setattr("relume_worker.runner.run_task", run_deleted)
    with open_service(tmp_path) as service:
        service.submit(SCENE.id, RECIPE)
        assert met.wait(30)
    assert [record.message for record in caplog.records if "failed" in record.message] == []


def test_leftovers_of_a_deleted_bake_are_not_attributed_to_another_version(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with open_service(tmp_path) as service:
        staging_path(service.data_dir, bake_id(SCENE.id, RECIPE)).mkdir(parents=True)
        assert follow(service, service.submit(SCENE.id, RECIPE)).problem is None
    assert "relume was updated" not in caplog.text


def test_bakes_requested_during_scene_deletion_are_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_service(tmp_path, delay_s=0.05) as service:
        recipes = [replace(RECIPE, num_lights=RECIPE.num_lights + k) for k in range(3)]
        struck = scenes.delete_bakes

        def request_again(data_dir: Path, ledger: Ledger, ids: Sequence[str]) -> None:
            struck(data_dir, ledger, ids)
            if recipes:
                service.submit(SCENE.id, recipes.pop())

        monkeypatch.setattr(scenes, "delete_bakes", request_again)
        delete_scene(service.data_dir, service.ledger, SCENE.id)
        assert recipes == []
        assert service.bakes() == []
        with pytest.raises(NotFoundError):
            service.submit(SCENE.id, RECIPE)


def test_abandoned_stores_are_removed_at_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stray = staging_path(tmp_path, "0" * 16)
    stray.mkdir(parents=True)
    service = open_service(tmp_path)
    listed = service.ledger.bakes

    def bakes_and_then_another_process_begins_one() -> list[BakeStatus]:
        before = listed()
        begun.append(staging_path(tmp_path, service.submit(SCENE.id, RECIPE)))
        begun[0].mkdir()
        return before

    begun: list[Path] = []
    with monkeypatch.context() as patch:
        patch.setattr(service.ledger, "bakes", bakes_and_then_another_process_begins_one)
        service._delete_orphans()
    service.close()
    assert not stray.exists()
    assert begun[0].exists()


def test_published_store_of_a_killed_service_is_used_unchanged(tmp_path: Path) -> None:
    service = open_service(tmp_path)
    identity = service.submit(SCENE.id, RECIPE)
    elsewhere = copy(service.ledger)
    elsewhere.owner = "elsewhere/1/nonce/0"
    assert elsewhere.claim(identity)
    bake_in_process(FakeMethod(), SCENE, RECIPE, service.store_path(identity))
    assert elsewhere.update_leased(identity, heartbeat=time.time() - 2 * lease.LEASE_S)
    with service:
        assert follow(service, identity).state == "ready"


def test_closing_ends_every_subscription(tmp_path: Path) -> None:
    service = open_service(tmp_path)
    identity = service.submit(SCENE.id, RECIPE)
    listens, ended = threading.Event(), threading.Event()

    def listen() -> None:
        for _ in service.subscribe(identity):
            listens.set()
        ended.set()

    thread = threading.Thread(target=listen)
    thread.start()
    assert listens.wait(60)
    service.close()
    thread.join(60)
    assert ended.is_set()


def test_store_reads_back_what_the_method_computed(tmp_path: Path) -> None:
    with open_service(tmp_path) as service:
        identity = service.submit(SCENE.id, RECIPE)
        follow(service, identity)
        store = open_store(service.store_path(identity))
        dark = store.read("views/1/depth") > 0.7
        assert dark.any()
        assert np.array_equal(~store.read("views/1/visibility").any(axis=1), dark)
