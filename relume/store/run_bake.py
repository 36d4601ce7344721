"""Run a transfer method into a store: stages, their arrays, single tasks. The worker calls these from its processes;
`bake_in_process` calls them sequentially, for tests, notebooks and measurements."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

from relume.core.errors import StoreError
from relume.core.source_hash import bake_code
from relume.look.document import default_look
from relume.scene.model import Scene
from relume.store.bake_protocol import BakeMethod, Recipe, Task, TaskOutput
from relume.store.publish import publish
from relume.store.reader import Reader, open_staging
from relume.store.writer import StoreWriter, create_store


def create_staging_store(method: BakeMethod, scene: Scene, recipe: Recipe, staging: Path) -> None:
    """Create the store of a bake, or keep the unfinished one, which this version of the code must have made.

    Args:
        method: provides the root attributes for this scene and recipe.
        scene: the scene. recipe: its recipe.
        staging: folder of the unfinished store; made if missing.
    """
    look = default_look(scene.materials, scene.lights)
    create_store(staging, {**method.attributes(scene, recipe), "look": look, "code": bake_code()})


def create_stage(method: BakeMethod, scene: Scene, recipe: Recipe, staging: Path, stage: int) -> Sequence[Task]:
    """Create the arrays of a stage and return its tasks.

    Args:
        method: the bake method.
        scene: the scene. recipe: its recipe.
        staging: folder of the unfinished store, in which the earlier stages are complete.
        stage: index into the stages of `method`.
    """
    reader, writer = open_staging(staging), StoreWriter(staging)
    for spec in method.arrays(stage, scene, recipe, reader):
        writer.create_array(spec)
    return method.tasks(stage, scene, recipe, reader)


@lru_cache(maxsize=4)
def open_stage_reader(staging: Path, stage: int, scene_id: str, recipe: Recipe) -> Reader:
    """Open one reader for all tasks of a stage in this process; its input is complete, so it is read only once.

    Args:
        staging: folder of the unfinished store.
        stage, scene_id, recipe: identify the cached reader.
    """
    return open_staging(staging)


def run_task(method: BakeMethod, scene: Scene, recipe: Recipe, staging: Path, task: Task) -> TaskOutput:
    """Compute a task and write its rows; doing it twice leaves the same bytes.

    Args:
        method: the bake method. scene: the scene. recipe: its recipe.
        staging: folder of the unfinished store, whose stage was created.
        task: one of those that `create_stage` returned.
    Returns:
        The result and its cost.
    Raises:
        StoreError: the number of rows differs from those that the task owns.
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
        method: the bake method. scene: the scene. recipe: its recipe.
        target: folder of the finished store; an unfinished one beside it is removed first.
        progress: called with each finished task and its output.
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
