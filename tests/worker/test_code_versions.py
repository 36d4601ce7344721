"""Code versions of bakes: those of another version stay usable and report it, and partial ones restart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene

from relume.core.errors import StoreError
from relume.store.reader import open_store, read_code
from relume_worker.paths import staging_path
from relume_worker.runner import CODE_CHANGED_MESSAGE
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService
from relume_worker.status import BakeStatus
from relume_worker.tasks import BakeInput, run_task

SCENE = tiny_scene()
NUM_TASKS = 2 + 2 * 9
OLD, NEW = "0123456789abcdef", "fedcba9876543210"


@pytest.fixture
def running(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Switch to another code version."""

    def run(code: str) -> None:
        for module in (
            "relume.store.run_bake",
            "relume_worker.status",
            "relume_worker.ledger",
            "relume_worker.bake_kind",
            "relume_worker.service",
            "relume_worker.tasks",
        ):
            monkeypatch.setattr(f"{module}.bake_code", lambda: code)

    return run


def open_service(data_dir: Path, **method: Any) -> BakeService:
    service = BakeService(data_dir, methods={"fake": FakeMethod(**method)})
    register_scene(service.data_dir, service.ledger, SCENE)
    return service


def follow(service: BakeService, identity: str) -> list[BakeStatus]:
    with service.subscribe(identity) as changes:
        return list(changes)


def interrupt(service: BakeService, identity: str) -> None:
    """Wait until some tasks are done."""
    with service.subscribe(identity) as changes:
        while (status := changes.get()) and status.progress < 0.3:
            pass


def test_bake_of_other_code_stays_usable_and_reports_it(tmp_path: Path, running: Callable[[str], None]) -> None:
    running(OLD)
    with open_service(tmp_path) as service:
        old = service.submit(SCENE.id, RECIPE)
        assert follow(service, old)[-1].is_current
        assert open_store(service.store_path(old)).attributes["code"] == service.get(old).code == OLD
    running(NEW)
    with open_service(tmp_path) as service:
        new = service.submit(SCENE.id, RECIPE)
        assert new != old
        follow(service, new)
        assert [(service.get(bake_id).code, service.get(bake_id).is_current) for bake_id in (old, new)] == [
            (OLD, False),
            (NEW, True),
        ]
        assert service.get(new).rank > service.get(old).rank
        moving = replace(service.get(new), recipe=replace(RECIPE, method="probes", size=(4096, 4096)))
        assert moving.rank < service.get(old).rank  # at any resolution it never becomes exact
        assert service.get(old).state == "ready"
        assert open_store(service.store_path(old)).attributes["code"] == OLD


@pytest.mark.parametrize("how", ["closed", "canceled"])
def test_partial_bake_of_other_code_restarts_with_a_reason(
    tmp_path: Path, running: Callable[[str], None], how: str
) -> None:
    log = tmp_path / "log"
    running(OLD)
    with open_service(tmp_path, delay_s=0.02, log=str(log)) as service:
        identity = service.submit(SCENE.id, RECIPE)
        interrupt(service, identity)
        if how == "canceled":
            service.cancel(identity)
            assert follow(service, identity)[-1].state == "canceled"
    num_old = len(log.read_text().split())
    assert 0 < num_old < NUM_TASKS
    running(NEW)
    service = open_service(tmp_path, delay_s=0.02, log=str(log))
    if how == "canceled":
        service._delete_orphans()
        assert not staging_path(tmp_path, identity).exists()
        service.ledger.requeue_bake(identity, ("canceled",))
    with service.subscribe(identity) as changes, service:
        statuses = list(changes)
        assert [statuses[-1].state, statuses[-1].problem, statuses[-1].code] == ["ready", None, NEW]
        assert read_code(service.store_path(identity)) == NEW
        assert open_store(service.store_path(identity)).attributes["code"] == NEW
    assert how == "canceled" or CODE_CHANGED_MESSAGE in {status.problem for status in statuses}
    assert len(log.read_text().split()) == num_old + NUM_TASKS


def test_process_of_other_code_computes_nothing(tmp_path: Path) -> None:
    job = BakeInput(tmp_path, "0" * 16, SCENE.id, RECIPE, FakeMethod(), OLD)
    with pytest.raises(StoreError, match="another version of relume"):
        run_task(job, None)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_store_without_a_code_version_has_none(tmp_path: Path) -> None:
    (tmp_path / "zarr.json").write_text('{"attributes": {"schema_version": 7}}')
    assert read_code(tmp_path) is None
    assert read_code(tmp_path / "nothing") is None
