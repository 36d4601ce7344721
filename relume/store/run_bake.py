"""Runs a transfer method into a store: the stages, their arrays, one task. The worker calls these from its processes;
`bake_in_process` calls them one after another, for tests, notebooks and measurements."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

from relume.core.errors import StoreError
from relume.core.source_hash import bake_code
from relume.scene.model import Scene
from relume.store.bake_protocol import BakeMethod, Recipe, Task, TaskOutput
from relume.store.publish import publish
from relume.store.reader import Reader, open_staging
from relume.store.writer import StoreWriter, create_store


def create_staging_store(method: BakeMethod, scene: Scene, recipe: Recipe, staging: Path) -> None:
    """Create the store of a bake, or keep the unfinished one that is there, which this code must have made.

    Args:
        method: whose root attributes of this scene and recipe the store gets.
        scene: that is baked. recipe: how.
        staging: folder of the unfinished store; made where it is missing.
    """
    create_store(staging, {**method.attributes(scene, recipe), "code": bake_code()})


def create_stage(method: BakeMethod, scene: Scene, recipe: Recipe, staging: Path, stage: int) -> Sequence[Task]:
    """Create the arrays that a stage announces and return its tasks.

    Args:
        method: whose stages the bake has.
        scene: that is baked. recipe: how.
        staging: folder of the unfinished store, in which the stages before this one are complete.
        stage: index into the stages of `method`.
    """
    reader, writer = open_staging(staging), StoreWriter(staging)
    for spec in method.arrays(stage, scene, recipe, reader):
        writer.create_array(spec)
    return method.tasks(stage, scene, recipe, reader)


@lru_cache(maxsize=4)
def open_stage_reader(staging: Path, stage: int, scene_id: str, recipe: Recipe) -> Reader:
    """One reader for all tasks of a stage that a process does: what they read is complete, and so read only once.

    Args:
        staging: folder of the unfinished store.
        stage, scene_id, recipe: tell this reader from those that were kept before.
    """
    return open_staging(staging)


def run_task(method: BakeMethod, scene: Scene, recipe: Recipe, staging: Path, task: Task) -> TaskOutput:
    """Compute a task and write its rows; doing it twice leaves the same bytes.

    Args:
        method: that computes. scene: that is baked. recipe: how.
        staging: folder of the unfinished store, whose stage has begun.
        task: one of those that `begin_stage` returned.
    Returns:
        What was computed, and what it cost.
    Raises:
        StoreError: the method has computed another number of rows than the task owns.
    """
    reader = open_stage_reader(staging, task.stage, scene.id, recipe)
    output = method.compute(scene, recipe, task, reader)
    announced = {spec.path for spec in method.arrays(task.stage, scene, recipe, reader)}
    writer = StoreWriter(staging)
    for path, rows in output.arrays.items():
        if path not in announced:
            writer.write_whole(path, rows)
        elif rows.shape[0] != task.stop - task.start:
            raise StoreError(f"task {task} computed {rows.shape[0]} rows of {path}")
        else:
            writer.write(path, rows[:], task.start)
    return output


def bake_in_process(
    method: BakeMethod,
    scene: Scene,
    recipe: Recipe,
    target: Path,
    progress: Callable[[Task, TaskOutput], None] = lambda task, written: None,
) -> Path:
    """Bake in this process and thread, and publish.

    Args:
        method: that bakes. scene: what. recipe: how.
        target: folder of the finished store; an unfinished one beside it is removed before.
        progress: called with each task that is done and what it has written.
    Returns:
        `target`.
    """
    staging, scene = target.with_name(f"{target.name}.staging"), recipe.add_cameras(scene)
    shutil.rmtree(staging, ignore_errors=True)
    create_staging_store(method, scene, recipe, staging)
    for stage in range(len(method.stages)):
        for task in create_stage(method, scene, recipe, staging, stage):
            progress(task, run_task(method, scene, recipe, staging, task))
    publish(staging, target)
    return target
