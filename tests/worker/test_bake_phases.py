"""Users see the phase of a bake: queue position, preparation before tracing, and publication."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numba as nb
import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene

from relume.store.bake_protocol import Plan, Task
from relume_cli.bake_progress import detail
from relume_worker.executor import TINY_BAKE_RAYS
from relume_worker.ledger import Ledger
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService
from relume_worker.status import BakeStatus, TaskCost
from relume_worker.task_notes import TaskNotes, note_path, read_note

LARGE = TINY_BAKE_RAYS + 1


@pytest.fixture
def entered(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Each phase recorded in the ledger, in order, once each."""
    phases: list[str] = []
    update = Ledger.update_leased

    def record(self: Ledger, identity: str, **columns: Any) -> bool:
        if (phase := columns.get("phase")) is not None and phases[-1:] != [phase]:
            phases.append(phase)
        return update(self, identity, **columns)

    monkeypatch.setattr(Ledger, "update_leased", record)
    return phases


@pytest.mark.parametrize("num_rays", [1000, LARGE], ids=["in this process", "in worker processes"])
def test_phases_of_a_bake(tmp_path: Path, entered: list[str], num_rays: int) -> None:
    with BakeService(tmp_path, num_workers=1, methods={"fake": FakeMethod(num_rays=num_rays)}) as service:
        register_scene(service.data_dir, service.ledger, tiny_scene())
        with service.subscribe(service.submit(tiny_scene().id, RECIPE)) as changes:
            statuses = list(changes)
    assert statuses[-1].state == "ready"
    assert (entered[0] == "starting") == (num_rays == LARGE)
    order = ["starting", "reading", "loading", "sampling", "tracing", "publishing"]
    known_phases = list(dict.fromkeys(phase for phase in entered if phase in order))  # a worker reads the scene, too
    assert known_phases == sorted(known_phases, key=order.index)
    assert {"reading", "sampling", "tracing", "publishing"} <= set(known_phases)
    assert all((status.phase is None) == (status.phase_since is None) for status in statuses)
    assert statuses[-1].phase is None
    assert not list((tmp_path / "bakes" / "staging").iterdir())


def test_queue_position_of_a_bake(tmp_path: Path) -> None:
    service = BakeService(tmp_path, methods={"fake": FakeMethod()})
    register_scene(service.data_dir, service.ledger, tiny_scene())
    recipes = [replace(RECIPE, num_lights=lights) for lights in (8, 16, 24, 32)]
    plans = [Plan(1, rays, 1, 1) for rays in (LARGE, 1000, LARGE, LARGE)]  # the tiny one has its own lane
    ids = [service.ledger.submit(tiny_scene().id, *arguments) for arguments in zip(recipes, plans, strict=True)]
    assert [service.get(identity).queue_position for identity in ids] == [0, 0, 1, 2]
    assert {status.id: status.queue_position for status in service.bakes()} == dict(zip(ids, [0, 0, 1, 2], strict=True))
    service.ledger.claim(ids[0])
    service.cancel(ids[2])
    assert [service.get(identity).queue_position for identity in ids] == [0, 0, 0, 1]
    service.close()


def test_kernel_compilation_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    write = TaskNotes._write

    def record(self: TaskNotes, note: Any) -> None:
        write(self, note)
        written.append(read_note(tmp_path / "one.zarr") or "")

    monkeypatch.setattr(TaskNotes, "_write", record)
    notes = TaskNotes(tmp_path / "one.zarr")
    kernel = nb.njit(lambda x: x + 1)
    with notes.watching_compiler():
        notes.note("working")
        assert kernel(1) == kernel(1) == 2
    assert kernel(1.0) == 2.0  # compiled again without a note
    assert written == ["working", "compiling", "working"]


def test_note_that_cannot_be_written_does_not_fail_the_bake(tmp_path: Path) -> None:
    TaskNotes(tmp_path / "nowhere" / "one.zarr").note("working")
    assert read_note(tmp_path / "nowhere" / "one.zarr") is None
    note_path(tmp_path / "one.zarr").write_text("something else")
    assert read_note(tmp_path / "one.zarr") is None


def test_command_line_prints_the_same_phases(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_cli.bake_progress.time.time", lambda: 1012.0)
    plan, none = Plan(1, 1, 1, 1), {"rays_per_second": None, "bytes": 0, "problem": None, "created": 0.0, "code": None}

    def status(state: Any, phase: Any, seconds_left: float | None = None, ahead: int = 0) -> BakeStatus:
        return BakeStatus(
            id="", scene="", state=state, progress=0.0, phase=phase, phase_since=1000.0, queue_position=ahead,
            seconds_left=seconds_left, recipe=RECIPE, plan=plan, **none,
        )  # fmt: skip

    assert detail(status("queued", None, ahead=2)) == "waiting, 2 before it in the queue"
    assert detail(status("running", "compiling", 5.0)) == "compiling kernels, once on this machine, 12 s"
    assert detail(status("running", "tracing")) == "tracing, estimating the time left"
    assert detail(status("running", "tracing", 41.4)) == "tracing, 41 s left"


def test_stage_times_come_from_bakes_of_the_same_scene_if_there_are_any(tmp_path: Path) -> None:
    service = BakeService(tmp_path, methods={"fake": FakeMethod()})
    scenes = [tiny_scene(name) for name in ("one", "two", "three")]
    for scene, seconds in zip(scenes[:2], (3.0, 5.0), strict=True):
        register_scene(service.data_dir, service.ledger, scene)
        identity = service.ledger.submit(scene.id, RECIPE, Plan(1, LARGE, 1, 1))
        service.ledger.claim(identity)
        for task in (Task(0, 0, "front", 0, 1), Task(1, 0, "front", 0, 1), Task(1, 1, "front", 1, 2)):
            service.ledger.finish_task(identity, task, TaskCost(1, seconds, seconds), 1)
        service.ledger.finish(identity, "ready")
    stage_seconds = [service.ledger.stage_seconds(scene.id, "fake", 2, 8) for scene in scenes]
    assert stage_seconds == [{0: 3.0, 1: 3.0}, {0: 5.0, 1: 5.0}, {0: 8.0, 1: 8.0}]
    assert service.ledger.stage_seconds(scenes[0].id, "other", 2, 8) == {}
    service.close()
