"""The ledger identifies each bake once, lets one owner run it, and keeps finished bakes."""

import os
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from copy import copy
from pathlib import Path

import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene
from sqlalchemy import text, update

from relume.core.errors import NotFoundError
from relume.store.bake_protocol import Recipe, Task
from relume_server.persistence.leases import RoomLeases
from relume_worker import lease
from relume_worker.database import open_database
from relume_worker.database.models import JobRow
from relume_worker.jobs.job import BAKE, UNREADABLE
from relume_worker.ledger import Ledger
from relume_worker.scenes import delete_scene, get_scene, list_scenes, register_scene
from relume_worker.status import TaskCost, bake_id, recipe_from_json, recipe_json

SCENE = tiny_scene()
PLAN = FakeMethod().plan(SCENE, RECIPE)


@pytest.fixture
def ledger(tmp_path: Path, ledger_url: str) -> Iterator[Ledger]:
    with closing(Ledger(open_database(ledger_url))) as ledger:
        register_scene(tmp_path, ledger, SCENE)
        yield ledger


def another(ledger: Ledger) -> Ledger:
    """Ledger of another service on the same database."""
    other = copy(ledger)
    other.owner = lease.new_owner()
    return other


def test_recipe_survives_json_and_names_the_bake() -> None:
    assert recipe_from_json(recipe_json(RECIPE)) == RECIPE
    others = [
        Recipe("fake", ("left", "front"), (16, 32), 24),
        Recipe("fake", ("front", "left"), (32, 16), 24),
        Recipe("fake", ("front", "left"), (16, 32), 25),
        Recipe("direct", ("front", "left"), (16, 32), 24),
    ]
    assert len({bake_id(SCENE.id, recipe) for recipe in [RECIPE, *others]} | {bake_id("0" * 16, RECIPE)}) == 6


def test_same_recipe_under_other_code_is_another_bake(monkeypatch: pytest.MonkeyPatch) -> None:
    before = bake_id(SCENE.id, RECIPE)
    monkeypatch.setattr("relume_worker.status.bake_code", lambda: "fedcba9876543210")
    assert bake_id(SCENE.id, RECIPE) != before


def test_same_recipe_from_many_threads_is_one_bake(ledger: Ledger) -> None:
    ids: list[str] = []
    threads = [threading.Thread(target=lambda: ids.append(ledger.submit(SCENE.id, RECIPE, PLAN))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert ids == [bake_id(SCENE.id, RECIPE)] * 8
    assert [status.state for status in ledger.bakes()] == ["queued"]


def test_unknown_scene_cannot_be_baked(ledger: Ledger) -> None:
    with pytest.raises(NotFoundError):
        ledger.submit("0" * 16, RECIPE, PLAN)


def test_only_one_of_many_claims_a_bake(ledger: Ledger) -> None:
    identity, won = ledger.submit(SCENE.id, RECIPE, PLAN), []

    def claim() -> None:
        service = another(ledger)
        if service.claim(identity):
            won.append(service)

    threads = [threading.Thread(target=claim) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(won) == 1
    assert ledger.claimable([BAKE]) == []
    assert won[0].update_leased(identity, progress=0.5)
    assert not ledger.update_leased(identity, progress=0.9)
    assert ledger.bake(identity).progress == 0.5


def test_lease_expires_without_renewal(ledger: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    identity, first, second = ledger.submit(SCENE.id, RECIPE, PLAN), another(ledger), another(ledger)
    assert first.claim(identity)
    monkeypatch.setattr(lease, "LEASE_S", -1.0)
    assert [work.id for work in ledger.claimable([BAKE])] == [identity]
    assert second.claim(identity)
    monkeypatch.undo()
    assert not first.update_leased(identity, progress=0.9)
    assert not first.finish(identity, "failed", problem="too late")
    assert ledger.bake(identity).state == "running"


def test_lease_of_a_dead_process_ends_immediately() -> None:
    host, _, nonce, number = lease.new_owner().split("/")
    assert lease.is_alive(lease.new_owner(), 100.0, 101.0)
    assert not lease.is_alive(f"{host}/{2**22 + 1}/{nonce}/{number}", 100.0, 101.0)
    assert lease.is_alive(f"{host}x/{2**22 + 1}/{nonce}/{number}", 100.0, 101.0)
    pid = lease.new_owner().split("/")[1]
    assert not lease.is_alive(f"{host}/{pid}/another-run-of-this-container/0", 100.0, 101.0)


def test_machines_are_distinguished_by_more_than_a_host_name(monkeypatch: pytest.MonkeyPatch) -> None:
    host_id, _, nonce, number = lease.new_owner().split("/")
    host, rest = host_id.split(":", 1)
    gone = 2**22 + 1
    assert not lease.may_run(f"{host_id}/{gone}/{nonce}/{number}")
    assert lease.may_run(f"{host}/{gone}/{nonce}/{number}"), "another machine may have the same name"
    assert lease.may_run(f"{host}:another-start{rest}/{gone}/{nonce}/{number}")
    assert lease.owner_text(lease.new_owner()).startswith(f"{host}, process ")


def test_owner_without_its_lease_records_and_deletes_nothing(
    ledger: Ledger, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    identity, first, second = ledger.submit(SCENE.id, RECIPE, PLAN), another(ledger), another(ledger)
    task, cost = Task(0, 1, "left", 0, 8), TaskCost(5, 0.1, 0.2)
    first.claim(identity)
    assert first.finish_task(identity, task, cost, 1)
    monkeypatch.setattr(lease, "LEASE_S", -1.0)
    assert second.claim(identity)
    assert "is taken over from" in caplog.text
    assert not first.renew_lease(identity)
    assert not first.finish_task(identity, Task(0, 2, "left", 8, 16), cost, 1)
    assert not first.delete_tasks(identity, is_running=True)
    assert not first.restart(identity, "code", "run", None)
    assert not first.finish(identity, "failed", problem="a problem")
    assert not first.release(identity)
    assert ledger.finished_tasks(identity) == {(0, 1): cost}
    status = ledger.bake(identity)
    assert (status.state, status.problem) == ("running", None)
    assert second.finish(identity, "ready")
    assert second.release(identity)


def test_canceled_bake_keeps_its_tasks_and_can_be_queued_again(ledger: Ledger) -> None:
    identity = ledger.submit(SCENE.id, RECIPE, PLAN)
    ledger.claim(identity)
    assert ledger.finish_task(identity, Task(0, 1, "left", 0, 8), TaskCost(5, 0.1, 0.2), 1)
    assert ledger.cancel(identity)
    assert not ledger.update_leased(identity, progress=0.5)
    assert not ledger.finish(identity, "ready")
    assert ledger.release(identity)
    assert ledger.bake(identity).state == "canceled"
    assert ledger.submit(SCENE.id, RECIPE, PLAN) == identity
    assert ledger.bake(identity).state == "queued"
    assert ledger.finished_tasks(identity) == {(0, 1): TaskCost(5, 0.1, 0.2)}


def test_finished_bake_cannot_be_canceled_and_stays_ready(ledger: Ledger) -> None:
    identity = ledger.submit(SCENE.id, RECIPE, PLAN)
    ledger.claim(identity)
    ledger.finish(identity, "ready", bytes=77, progress=1.0)
    assert not ledger.cancel(identity)
    ledger.submit(SCENE.id, RECIPE, PLAN)
    status = ledger.bake(identity)
    assert (status.state, status.bytes, status.progress) == ("ready", 77, 1.0)


@pytest.mark.parametrize("column", ["request", "plan"])
@pytest.mark.parametrize("state", ["queued", "ready"])
def test_bake_with_a_damaged_row_has_failed_until_it_is_requested_again(
    ledger: Ledger, column: str, state: str
) -> None:
    damaged, other = ledger.submit(SCENE.id, RECIPE, PLAN), Recipe("fake", ("front",), (8, 8), 3)
    intact = ledger.submit(SCENE.id, other, PLAN)
    with ledger.sessions.begin() as session:
        values = {column: '{"method": "fake"}', "state": state}
        session.execute(update(JobRow).where(JobRow.id == damaged).values(values))
    statuses = {status.id: (status.state, status.problem) for status in ledger.bakes()}
    assert statuses == {damaged: ("failed", UNREADABLE), intact: ("queued", None)}
    assert ledger.bake(damaged) in ledger.bakes_of_scenes([SCENE.id])[SCENE.id]
    assert {work.id for work in ledger.claimable([BAKE])} >= {intact}
    assert ledger.finished_bakes(8) == []
    assert ledger.cancel(damaged) == (state == "queued")
    assert ledger.submit(SCENE.id, RECIPE, PLAN) == damaged
    assert (ledger.bake(damaged).state, ledger.bake(damaged).recipe) == ("queued", RECIPE)


def test_scenes_are_listed_and_deleted_with_their_bakes(tmp_path: Path, ledger: Ledger) -> None:
    other = register_scene(tmp_path, ledger, tiny_scene("second"))
    register_scene(tmp_path, ledger, SCENE)
    assert {record.id for record in list_scenes(ledger)} == {SCENE.id, other}
    record = get_scene(ledger, SCENE.id)
    assert (record.name, record.views, record.num_triangles) == ("triangle", ("front", "left"), 1)
    assert record.materials[0]["terms"][0]["model"] == "lambert"
    identity = ledger.submit(SCENE.id, RECIPE, PLAN)
    ledger.claim(identity)
    assert ledger.finish_task(identity, Task(0, 1, "left", 0, 8), TaskCost(5, 0.1, 0.2), 1)
    delete_scene(tmp_path, ledger, SCENE.id)
    assert [record.id for record in list_scenes(ledger)] == [other]
    assert ledger.bakes() == []
    assert not (tmp_path / "scenes" / SCENE.id).exists()
    with pytest.raises(NotFoundError):
        get_scene(ledger, SCENE.id)


def test_malformed_ids_are_not_found(tmp_path: Path, ledger: Ledger) -> None:
    for identity in ("../../etc", "", "0" * 15, "G" * 16, "0" * 16 + "\n", "x" * 10_000):
        with pytest.raises(NotFoundError):
            delete_scene(tmp_path, ledger, identity)
        with pytest.raises(NotFoundError):
            ledger.bake(identity)


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="the system does not list open files")
def test_open_files_are_bounded_by_the_connection_limit(tmp_path: Path) -> None:
    engine, counts = open_database(f"sqlite:///{tmp_path / 'relume.db'}"), []
    for num_at_once in (5, 15, 15, 3, 15):
        with ExitStack() as stack:
            for _ in range(num_at_once):
                stack.enter_context(engine.connect()).execute(text("SELECT 1"))
        links = [os.readlink(file.path) for file in os.scandir("/proc/self/fd") if os.path.islink(file.path)]
        counts.append(sum(link.startswith(str(tmp_path)) for link in links))
    engine.dispose()
    assert counts[1:] == [counts[1]] * 4
    assert counts[1] <= counts[0] + 10


@pytest.fixture
def _long_leases(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.persistence.leases.ROOM_LEASE_S", 600.0)


@pytest.mark.usefixtures("_long_leases")
def test_room_belongs_to_one_server_until_it_releases_it_or_dies(ledger: Ledger) -> None:
    first, second = RoomLeases(ledger.sessions), RoomLeases(ledger.sessions)
    assert first.take("a")
    assert not second.take("a")
    assert first.take("a")
    assert first.renew({"a", "b"}) == set()
    assert [second.take(each) for each in "abc"] == [False, False, True]
    assert first.renew({"b"}) == set()
    assert [second.take(each) for each in "abc"] == [True, False, True]
    with ledger.sessions.begin() as session:
        session.execute(text("UPDATE rooms SET heartbeat = heartbeat - 700"))
    assert second.take("b")
    assert first.renew({"b"}) == {"b"}
    assert second.renew(()) == set()
    assert first.renew({"b"}) == set()
    assert not second.take("b")
    with ledger.sessions.begin() as session:
        session.execute(text("UPDATE rooms SET heartbeat = heartbeat - 86400"))
    second.renew(())
    with ledger.sessions.begin() as session:
        assert session.scalar(text("SELECT count(*) FROM rooms")) == 0


@pytest.mark.usefixtures("_long_leases")
def test_one_of_many_servers_that_open_a_room_gets_it(ledger: Ledger) -> None:
    servers = [RoomLeases(ledger.sessions) for _ in range(4)]
    with ThreadPoolExecutor(4) as threads:
        assert sum(threads.map(lambda each: each.take("a"), servers)) == 1
        with ledger.sessions.begin() as session:
            session.execute(text("UPDATE rooms SET heartbeat = 0"))
        assert sum(threads.map(lambda each: each.take("a"), servers)) == 1
