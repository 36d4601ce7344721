"""What every transfer method's bakes promise: a new one inherits these tests by standing in the registry.

Tasks tile what they fill, once; neither their order nor an interruption changes a byte; a store that is opened again
gives the same arrays; a method that travels to another process computes the same there.
"""

import hashlib
import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracle import KEPT

from relume.bake import Recipe, Task
from relume.errors import PlanError
from relume.methods.base import TransferMethod
from relume.scene.model import Scene
from relume.store import bake_here, fill, open_staging, open_store, publish
from relume.store.publish import array_paths


def tree_hash(folder: Path) -> str:
    """Of what was baked; images that pictures of other tests have kept beside it, and edited ones, are left out."""
    digest = hashlib.sha256()
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
        if file.relative_to(folder).parts[0] in KEPT:
            continue
        digest.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def bake_in_another_way(
    method: TransferMethod, scene: Scene, recipe: Recipe, folder: Path, *, backwards: bool, twice: bool
) -> Path:
    """Every task with a copy of the method as another process gets it; `twice`: as after an interruption."""
    staging = folder / "staging"
    for _ in range(2 if twice else 1):
        fill.begin(method, scene, recipe, staging)
        for stage in range(len(method.stages)):
            tasks = list(fill.begin_stage(method, scene, recipe, staging, stage))
            for task in reversed(tasks) if backwards else tasks:
                copy: TransferMethod = pickle.loads(pickle.dumps(method))
                fill.run_task(copy, scene, recipe, staging, task)
    publish(staging, folder / "store.zarr")
    return folder / "store.zarr"


def test_plan_bounds_what_the_bake_takes(method: TransferMethod, scene: Scene, recipe: Recipe, tmp_path: Path) -> None:
    plan, rays = method.plan(scene, recipe), []
    bake_here(method, scene, recipe, tmp_path / "s.zarr", lambda _, written: rays.append(written.num_rays))
    reader = open_store(tmp_path / "s.zarr")
    stored = sum(reader.read(path).nbytes for path in array_paths(tmp_path / "s.zarr"))
    assert 0 < sum(rays) <= plan.num_rays
    assert 0 < stored <= plan.store_bytes


def test_plan_is_pure(method: TransferMethod, scene: Scene, recipe: Recipe) -> None:
    assert method.plan(scene, recipe) == method.plan(scene, recipe)
    assert json.loads(json.dumps(method.attributes(scene, recipe))) == method.attributes(scene, recipe)


@pytest.mark.parametrize(
    "changes", [{"views": ("nowhere",)}, {"views": ()}, {"num_lights": 10**9}, {"num_lights": 0}, {"size": (0, 0)}]
)
def test_recipe_that_does_not_fit_is_refused_by_the_plan(
    method: TransferMethod, scene: Scene, recipe: Recipe, changes: dict[str, Any]
) -> None:
    with pytest.raises(PlanError):
        method.plan(scene, replace(recipe, **changes))


def test_tasks_tile_every_announced_array_once(
    method: TransferMethod, scene: Scene, recipe: Recipe, tmp_path: Path
) -> None:
    staging = tmp_path / "staging"
    fill.begin(method, scene, recipe, staging)
    for stage in range(len(method.stages)):
        tasks = fill.begin_stage(method, scene, recipe, staging, stage)
        assert [(task.stage, task.index) for task in tasks] == [(stage, index) for index in range(len(tasks))]
        specs = {spec.path: spec for spec in method.arrays(stage, scene, recipe, open_staging(staging))}
        rows: dict[str, list[tuple[int, int]]] = {path: [] for path in specs}
        for task in tasks:
            for path in fill.run_task(method, scene, recipe, staging, task).arrays:
                if path in specs:
                    assert task.start % specs[path].shards[0] == 0
                    rows[path].append((task.start, task.stop))
        for path, spec in specs.items():
            ends = [0, *(stop for _, stop in sorted(rows[path]))]
            assert [start for start, _ in sorted(rows[path])] == ends[:-1]
            assert ends[-1] == spec.shape[0]


@pytest.mark.parametrize(
    ("backwards", "twice"),
    [pytest.param(True, False, id="backwards", marks=pytest.mark.slow), pytest.param(False, True, id="twice")],
)
def test_neither_order_nor_repetition_changes_a_byte(
    method: TransferMethod, scene: Scene, recipe: Recipe, baked: Path, tmp_path: Path, backwards: bool, twice: bool
) -> None:
    other = bake_in_another_way(method, scene, recipe, tmp_path, backwards=backwards, twice=twice)
    assert tree_hash(other) == tree_hash(baked)


def test_bake_interrupted_in_a_stage_resumes_to_the_same_bytes(
    method: TransferMethod, scene: Scene, recipe: Recipe, baked: Path, tmp_path: Path
) -> None:
    staging, done = tmp_path / "staging", set()

    def go_on(stop_after: int | None) -> None:
        fill.begin(method, scene, recipe, staging)
        for stage in range(len(method.stages)):
            for task in fill.begin_stage(method, scene, recipe, staging, stage):
                if stop_after is not None and len(done) >= stop_after:
                    return
                if (stage, task.index) not in done:
                    fill.run_task(method, scene, recipe, staging, task)
                    done.add((stage, task.index))

    for stop_after in (1, 3, None):
        go_on(stop_after)
    publish(staging, tmp_path / "store.zarr")
    assert tree_hash(tmp_path / "store.zarr") == tree_hash(baked)


def test_task_alone_computes_what_it_computed_in_the_bake(
    method: TransferMethod, scene: Scene, recipe: Recipe, baked: Path
) -> None:
    store = open_store(baked)
    for stage in range(len(method.stages)):
        announced = {spec.path for spec in method.arrays(stage, scene, recipe, store)}
        for task in reversed(method.tasks(stage, scene, recipe, store)):
            for path, rows in method.compute(scene, recipe, task, store).arrays.items():
                span = (task.start, task.stop) if path in announced else (0, None)
                np.testing.assert_array_equal(store.read(path, *span), rows)


def test_unknown_task_does_not_pass_silently(method: TransferMethod, scene: Scene, recipe: Recipe, baked: Path) -> None:
    with pytest.raises(ValueError, match="not in"):
        method.compute(scene, recipe, Task(len(method.stages) - 1, 0, "no such view", 0, 1), open_store(baked))
