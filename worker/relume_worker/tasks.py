"""Run one task in one process: load the scene once, compute, write complete shards."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from relume.core.errors import StoreError
from relume.core.memory_usage import live_bytes, trim_heap
from relume.core.source_hash import bake_code
from relume.scene.model import Scene
from relume.scene.scene_folder import load_scene
from relume.store import run_bake
from relume.store.bake_protocol import BakeMethod, Recipe, Task
from relume_worker.idle_timer import IdleTimer, idle_seconds
from relume_worker.paths import scene_path, staging_path
from relume_worker.status import TaskCost
from relume_worker.storage import fetch_if_missing
from relume_worker.task_notes import TaskNotes

CODE_MISMATCH_MESSAGE = "a worker process runs another version of relume than the server; restart both, then bake again"


@dataclass(frozen=True)
class BakeInput:
    """Input of all tasks of a bake; small, it is sent with every task.

    Attributes:
        data_dir: data directory, at the same path on every machine of a cluster.
        code: code version of the submitting process.
    """

    data_dir: Path
    bake_id: str
    scene_id: str
    recipe: Recipe
    method: BakeMethod
    code: str


@lru_cache(maxsize=2)
def load_registered_scene(data_dir: Path, scene_id: str) -> Scene:
    """Load a registered scene; a process caches the last two."""
    return load_scene(fetch_if_missing(scene_path(data_dir, scene_id)))


_methods: dict[bytes, BakeMethod] = {}


def _intern_method(method: BakeMethod) -> BakeMethod:
    """This process's own copy of a method with its cached data for a scene; each task brings a fresh copy."""
    return _methods.setdefault(pickle.dumps(method), method)


_idle_callbacks: list[Callable[[], None]] = []


def when_idle(release: Callable[[], None]) -> Callable[[], None]:
    """Decorate a function that releases something of this process after some time without tasks."""
    _idle_callbacks.append(release)
    return release


def _release_caches() -> None:
    """Release cached scenes, methods' data and store contents."""
    for release in _idle_callbacks:
        release()
    load_registered_scene.cache_clear()
    _methods.clear()
    run_bake.open_stage_reader.cache_clear()
    trim_heap()


idle_timer = IdleTimer(idle_seconds, _release_caches)
"""Releases the caches of this process after some time without tasks."""


def cached_bytes() -> int:
    """Bytes cached between tasks, without Embree's structures, which take about as much again."""
    return live_bytes(load_registered_scene, _methods, run_bake.open_stage_reader)


def run_task(bake: BakeInput, task: Task) -> TaskCost:
    """Compute a task and write its shards into the unfinished store; repeating it gives the same bytes.

    Raises:
        StoreError: this process runs other code than the submitting one; a store must be made by one version.
    """
    if bake.code != bake_code():
        raise StoreError(CODE_MISMATCH_MESSAGE)
    start_s = time.perf_counter()
    staging = staging_path(bake.data_dir, bake.bake_id)
    notes = TaskNotes(staging)
    with idle_timer.keep_awake(), notes.watching_compiler():
        notes.note("reading")
        scene = bake.recipe.add_cameras(load_registered_scene(bake.data_dir, bake.scene_id))
        method = _intern_method(bake.method)
        notes.note("building")
        method.prepare(scene)
        notes.note("working")
        written = run_bake.run_task(method, scene, bake.recipe, staging, task)
    return TaskCost(written.num_rays, written.trace_s, time.perf_counter() - start_s)
