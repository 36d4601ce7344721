"""Prewarming: one server computes the first picture of a new bake without competing with open sessions."""

import fcntl
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pg8000
import pytest
from server_fakes import InThreadSteps
from tiny_scenes import still_life

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_bake
from relume.store.bake_protocol import Recipe
from relume_server.batch import prewarm as module
from relume_server.batch.prewarm import Prewarmer
from relume_server.batch.thumbnails import Thumbnails
from relume_server.runtime.library import open_library
from relume_server.settings import Settings
from relume_worker.jobs.step import IsNeeded, ProgressCallback, Step
from relume_worker.paths import bake_path
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService
from relume_worker.storage.locks import open_lock_file

SIZE = (24, 16)
AWAY = pg8000.InterfaceError("refused")


class Steps:
    """Run steps in this process and record them; `before` is called first."""

    def __init__(self, data: Path) -> None:
        self._here = InThreadSteps(Settings(data=data), open_library(1 << 28, 0))
        self.asked: list[tuple[str, str]] = []
        self.is_done = threading.Event()
        self.before: Callable[[IsNeeded], None] = lambda is_wanted: None

    def run(self, step: Step, tell: ProgressCallback, is_wanted: IsNeeded) -> Mapping[str, Any]:
        self.before(is_wanted)
        self.asked.append((step.kind, step.values["bake"]))
        answer = self._here.run(step, tell, is_wanted)
        if step.kind.startswith("thumbnail"):
            self.is_done.set()
        return answer


@pytest.fixture
def bakes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[BakeService]:
    monkeypatch.setattr(module, "POLL_INTERVAL_S", 0.02)
    with BakeService(tmp_path) as service:
        yield service


def bake(bakes: BakeService, num_lights: int = 40) -> str:
    scene = register_scene(bakes.data_dir, bakes.ledger, still_life())
    identity = bakes.submit(scene, Recipe("direct", ("front",), SIZE, num_lights))
    with bakes.subscribe(identity) as changes:
        assert list(changes)[-1].state == "ready"
    return identity


def prewarmer_of(bakes: BakeService, steps: Steps, is_used: Callable[[str], bool] = lambda bake: False) -> Prewarmer:
    thumbnails = Thumbnails(bakes.data_dir / "thumbnails", steps.run)
    return Prewarmer(bakes.data_dir, bakes.ledger, steps.run, thumbnails, is_used)


def exact_image(bakes: BakeService, identity: str) -> np.ndarray:
    """Exact image of a bake with an empty cache. (height, width, 3)"""
    path, memory = bake_path(bakes.data_dir, identity), Cache(1 << 28)
    picture = Picture(open_bake(path, memory), "front", memory)
    while not picture.advance(None).exact or picture.next_job() is not None:
        picture.run_next_job(lambda share: None, lambda: False)
    return picture.image()


def test_new_bake_opens_with_its_exact_picture(bakes: BakeService, monkeypatch: pytest.MonkeyPatch) -> None:
    before, steps = bake(bakes), Steps(bakes.data_dir)
    prewarmer = prewarmer_of(bakes, steps)
    prewarmer.start()
    assert steps.is_done.wait(60)
    steps.is_done.clear()
    later = bake(bakes, num_lights=50)
    assert steps.is_done.wait(60)
    prewarmer.close()
    assert [bake for _, bake in steps.asked] == [before, before, later, later]
    assert len(list((bakes.data_dir / "thumbnails").iterdir())) == 2

    with monkeypatch.context() as patched:
        patched.setattr("relume.operators.shade.shade_rows", fail_if_shaded)
        stored_picture = exact_image(bakes, later)
    for file in bake_path(bakes.data_dir, later).glob("derived/*/*.npy"):
        file.unlink()
    np.testing.assert_array_equal(stored_picture, exact_image(bakes, later))


def stored_arrays(bakes: BakeService, identity: str) -> dict[str, np.ndarray]:
    files = bake_path(bakes.data_dir, identity).glob("derived/*/*.npy")
    return {file.name: np.load(file) for file in files}


def fail_if_shaded(*args: object, **named: object) -> None:
    raise AssertionError("nothing may be shaded")


def test_open_bakes_are_not_prewarmed(bakes: BakeService) -> None:
    mine, other, steps = bake(bakes), bake(bakes, num_lights=50), Steps(bakes.data_dir)
    prewarmer = prewarmer_of(bakes, steps, lambda bake: bake == mine)
    prewarmer.start()
    assert steps.is_done.wait(60)
    prewarmer.close()
    assert {bake for _, bake in steps.asked} == {other}


def test_opening_the_bake_or_closing_the_server_stops_prewarming(bakes: BakeService) -> None:
    used: set[str] = set()
    identity, steps, asked = bake(bakes), Steps(bakes.data_dir), threading.Event()

    def wait(is_wanted: IsNeeded) -> None:
        assert is_wanted()
        used.add(identity)
        assert not is_wanted()
        used.clear()
        asked.set()
        while is_wanted():
            threading.Event().wait(0.01)

    steps.before = wait
    prewarmer = prewarmer_of(bakes, steps, used.__contains__)
    prewarmer.start()
    assert asked.wait(60)
    prewarmer.close()
    assert stored_arrays(bakes, identity) == {}


@contextmanager
def closing_lock(path: Path) -> Iterator[None]:
    """Another server holds the lock meanwhile."""
    lock = open_lock_file(path, fcntl.LOCK_EX)
    try:
        yield
    finally:
        os.close(lock)


def test_one_of_several_servers_prewarms(bakes: BakeService) -> None:
    identity, first, second = bake(bakes), Steps(bakes.data_dir), Steps(bakes.data_dir)
    is_held, may_go = threading.Event(), threading.Event()

    def wait_until_released(is_wanted: IsNeeded) -> None:
        is_held.set()
        assert may_go.wait(60)

    first.before = wait_until_released
    servers = [prewarmer_of(bakes, first), prewarmer_of(bakes, second)]
    servers[0].start()
    assert is_held.wait(60)
    servers[1].start()
    threading.Event().wait(0.2)  # ten rounds
    assert second.asked == []
    may_go.set()
    assert first.is_done.wait(60)
    for server in servers:
        server.close()
    assert second.asked == []
    assert stored_arrays(bakes, identity)


def test_bake_deleted_during_prewarming_leaves_no_files(bakes: BakeService, caplog: pytest.LogCaptureFixture) -> None:
    identity, steps, is_over = bake(bakes), Steps(bakes.data_dir), threading.Event()

    def delete(is_wanted: IsNeeded) -> None:
        bakes.delete(identity)
        is_over.set()

    steps.before = delete
    prewarmer = prewarmer_of(bakes, steps)
    prewarmer.start()
    assert is_over.wait(60)
    prewarmer.close()
    assert not bake_path(bakes.data_dir, identity).exists()
    assert [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")] == []
