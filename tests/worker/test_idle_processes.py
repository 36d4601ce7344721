"""Caches of a process are cleared when it is idle, and never during a task."""

import threading
import weakref
from pathlib import Path

import numpy as np
import pytest
from fake_method import RECIPE, FakeMethod, tiny_scene

from relume.raytrace.texture import MipMap
from relume.scene.model import Texture
from relume_worker import tasks
from relume_worker.idle_timer import DEFAULT_IDLE_S, IdleTimer, idle_seconds
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

WAIT_S = 60


class Timers:
    """A fake `threading.Timer`; the test advances the time."""

    def __init__(self) -> None:
        self.running: list[Timers.One] = []
        timers = self

        class One:
            def __init__(self, after_s: float, call: object) -> None:
                self.call, self.daemon = call, False

            def start(self) -> None:
                assert self.daemon  # it must not block process exit
                timers.running.append(self)

            def cancel(self) -> None:
                timers.running.remove(self)

        self.Timer = One

    def elapse(self) -> None:
        for timer in list(self.running):
            timer.call()


def test_nothing_is_cleared_while_a_task_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    timers, forgotten = Timers(), []
    monkeypatch.setattr(threading, "Timer", timers.Timer)
    idle_timer = IdleTimer(lambda: 60.0, lambda: forgotten.append(True))
    with idle_timer.keep_awake():
        with idle_timer.keep_awake():
            timers.elapse()
        timers.elapse()
    assert forgotten == []
    with pytest.raises(ZeroDivisionError), idle_timer.keep_awake():
        _ = 1 / 0
    assert len(timers.running) == 1
    timers.elapse()
    assert forgotten == [True]


def test_scene_and_its_acceleration_data_are_released_after_a_bake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELUME_IDLE_SECONDS", "1")
    forgotten = threading.Event()
    monkeypatch.setattr(tasks, "trim_heap", forgotten.set)
    with BakeService(tmp_path, methods={"fake": FakeMethod()}) as service:
        scene = tiny_scene("one that goes")
        register_scene(service.data_dir, service.ledger, scene)
        with service.subscribe(service.submit(scene.id, RECIPE)) as changes:
            assert list(changes)[-1].state == "ready"
        with tasks.idle_timer.keep_awake():
            loaded = weakref.ref(tasks.load_registered_scene(service.data_dir, scene.id))
            assert tasks.cached_bytes() > 0
            forgotten.clear()
        assert forgotten.wait(WAIT_S)
    assert loaded() is None
    assert tasks.cached_bytes() == 0


def test_idle_seconds_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RELUME_IDLE_SECONDS", raising=False)
    assert idle_seconds() == DEFAULT_IDLE_S
    for text, seconds in (("5", 5.0), ("0", 1.0), ("soon", DEFAULT_IDLE_S)):
        monkeypatch.setenv("RELUME_IDLE_SECONDS", text)
        assert idle_seconds() == seconds


def test_texture_pyramid_is_released_with_its_texture() -> None:
    texture = Texture(np.zeros((4, 4, 3), np.float32))
    pyramid = weakref.ref(MipMap.for_texture(texture))
    assert MipMap.for_texture(texture) is pyramid()
    del texture
    assert pyramid() is None
