"""Requirements on bakes of every method; new methods inherit these tests through the registry.

Tasks tile their arrays exactly once; neither task order nor interruption changes a byte; a reopened store
gives the same arrays; a method that is pickled to another process computes the same result there.
"""

import hashlib
import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exact_pictures import DERIVED_FOLDERS
from watched_bakes import Bake

from relume.core.errors import PlanError
from relume.scene.model import Scene
from relume.store import run_bake
from relume.store.bake_protocol import BakeMethod, Recipe, Task
from relume.store.publish import array_paths, publish
from relume.store.reader import open_store


def tree_hash(folder: Path) -> str:
    """Hash of the baked files, without images that other tests stored or edited there."""
    digest = hashlib.sha256()
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
        if file.relative_to(folder).parts[0] in DERIVED_FOLDERS:
            continue
        digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def run_elsewhere(method: BakeMethod, scene: Scene, recipe: Recipe, staging: Path, task: Task) -> None:
    """Run a task with a pickled copy of the method, as another process would."""
    copy: BakeMethod = pickle.loads(pickle.dumps(method))
    run_bake.run_task(copy, scene, recipe, staging, task)


def test_plan_is_an_upper_bound_of_the_bake(method: BakeMethod, scene: Scene, recipe: Recipe, watched: Bake) -> None:
    plan, reader = method.plan(scene, recipe), open_store(watched.store)
    paths = [path for path in array_paths(watched.store) if path.split("/")[0] not in DERIVED_FOLDERS]
    stored = sum(reader.read(path).nbytes for path in paths)
    assert 0 < sum(done.num_rays for done in watched.done) <= plan.num_rays
    assert 0 < stored <= plan.store_bytes


def test_plan_is_pure(method: BakeMethod, scene: Scene, recipe: Recipe) -> None:
    assert method.plan(scene, recipe) == method.plan(scene, recipe)
    assert json.loads(json.dumps(method.attributes(scene, recipe))) == method.attributes(scene, recipe)


@pytest.mark.parametrize(
    "changes", [{"views": ("nowhere",)}, {"views": ()}, {"num_lights": 10**9}, {"num_lights": 0}, {"size": (0, 0)}]
)
def test_invalid_recipe_is_rejected_by_the_plan(
    method: BakeMethod, scene: Scene, recipe: Recipe, changes: dict[str, Any]
) -> None:
    with pytest.raises(PlanError):
        method.plan(scene, replace(recipe, **changes))


def test_tasks_tile_every_announced_array_once(method: BakeMethod, scene: Scene, recipe: Recipe, watched: Bake) -> None:
    store = open_store(watched.store)
    for stage in range(len(method.stages)):
        here = [done for done in watched.done if done.task.stage == stage]
        assert [done.task.index for done in here] == list(range(len(here)))
        specs = {spec.path: spec for spec in method.arrays(stage, scene, recipe, store)}
        rows: dict[str, list[tuple[int, int]]] = {path: [] for path in specs}
        for task, paths, _ in here:
            for path in specs.keys() & set(paths):
                assert task.start % specs[path].shards[0] == 0
                rows[path].append((task.start, task.stop))
        for path, spec in specs.items():
            ends = [0, *(stop for _, stop in sorted(rows[path]))]
            assert [start for start, _ in sorted(rows[path])] == ends[:-1]
            assert ends[-1] == spec.shape[0]


@pytest.mark.slow
def test_task_order_changes_no_byte(
    method: BakeMethod, scene: Scene, recipe: Recipe, baked: Path, tmp_path: Path
) -> None:
    staging = tmp_path / "staging"
    run_bake.create_staging_store(method, scene, recipe, staging)
    for stage in range(len(method.stages)):
        for task in reversed(run_bake.create_stage(method, scene, recipe, staging, stage)):
            run_elsewhere(method, scene, recipe, staging, task)
    publish(staging, tmp_path / "store.zarr")
    assert tree_hash(tmp_path / "store.zarr") == tree_hash(baked)


def test_neither_interruption_nor_repetition_changes_a_byte(
    method: BakeMethod, scene: Scene, recipe: Recipe, baked: Path, tmp_path: Path
) -> None:
    staging, done = tmp_path / "staging", list[tuple[int, int]]()

    def resume(stop_after: int | None) -> None:
        run_bake.create_staging_store(method, scene, recipe, staging)
        for stage in range(len(method.stages)):
            for task in run_bake.create_stage(method, scene, recipe, staging, stage):
                if stop_after is not None and len(done) >= stop_after:
                    return
                if (stage, task.index) not in done:
                    run_elsewhere(method, scene, recipe, staging, task)
                    done.append((stage, task.index))

    for stop_after in (1, 3, None, None):
        resume(stop_after)
        done.pop()  # the newest task of each run is repeated by the next one
    publish(staging, tmp_path / "store.zarr")
    assert tree_hash(tmp_path / "store.zarr") == tree_hash(baked)


def test_single_task_reproduces_its_rows(method: BakeMethod, scene: Scene, recipe: Recipe, baked: Path) -> None:
    store = open_store(baked)
    for stage in range(len(method.stages)):
        announced = {spec.path for spec in method.arrays(stage, scene, recipe, store)}
        for task in reversed(method.tasks(stage, scene, recipe, store)):
            for path, rows in method.compute(scene, recipe, task, store).arrays.items():
                span = (task.start, task.stop) if path in announced else (0, None)
                np.testing.assert_array_equal(store.read(path, *span), rows)


def test_unknown_task_is_an_error(method: BakeMethod, scene: Scene, recipe: Recipe, baked: Path) -> None:
    with pytest.raises(ValueError, match="not in"):
        method.compute(scene, recipe, Task(len(method.stages) - 1, 0, "no such view", 0, 1), open_store(baked))
