"""What every transfer method promises: a new one inherits these tests by standing in the registry.

Tasks tile what they fill, once; neither their order nor an interruption changes a byte; a store that is opened again
gives the same arrays; a method that travels to another process computes the same there.
"""

import hashlib
import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from relume.errors import PlanError, RelumeError
from relume.scene.archive import make_scene
from relume.scene.model import Camera, Environment, Material, Mesh, Scene
from relume.store import bake_here, fill, open_staging, open_store, publish
from relume.store.publish import array_paths
from relume.transfer.base import Recipe, Task, TransferMethod
from relume.transfer.registry import METHODS

SIZE, NUM_LIGHTS = (48, 36), 100


def _quad(name: str, corners: list[list[float]], material: int) -> Mesh:
    positions = np.array(corners, np.float32)
    normal = np.cross(positions[1] - positions[0], positions[2] - positions[0])
    normals = np.tile((normal / np.linalg.norm(normal)).astype(np.float32), (4, 1))
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh(name, positions, normals, np.zeros((4, 4), np.float32), np.zeros((4, 2), np.float32), faces, material)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A floor and a wall that shadows it, a name that is hard on file names, two views, light from one side."""
    floor = _quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    wall = _quad("wall", [[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]], 1)
    glossy = {"model": "blinn_phong", "color": [0.4, 0.4, 0.4], "params": {"exponent": 20.0}}
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.6, 0.5, 0.4]},)),
        Material("Wall", ({"model": "lambert", "color": [0.2, 0.3, 0.5]}, glossy)),
    ]
    cosine, sine = np.cos(-0.5), np.sin(-0.5)
    front = np.eye(4)
    front[:3, :3] = [[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]
    front[:3, 3] = [0, 1.8, 3]
    side = front.copy()
    side[0, 3] = 0.7
    cameras = [Camera("front", front, 0.9), Camera("Seite nº 2: ../c", side, 0.9)]
    radiance = np.random.default_rng(7).random((16, 32, 3), np.float32)
    radiance[:6, 3:7] += 20
    return make_scene("contract", [floor, wall], materials, cameras, Environment("side", radiance))


@pytest.fixture(scope="module", params=sorted(METHODS))
def method(request: pytest.FixtureRequest) -> TransferMethod:
    return METHODS[request.param]


@pytest.fixture(scope="module")
def recipe(method: TransferMethod, scene: Scene) -> Recipe:
    return Recipe(method.name, tuple(camera.name for camera in scene.cameras), SIZE, NUM_LIGHTS)


@pytest.fixture(scope="module")
def baked(method: TransferMethod, scene: Scene, recipe: Recipe, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An undisturbed bake."""
    return bake_here(method, scene, recipe, tmp_path_factory.mktemp("contract") / "store.zarr")


def tree_hash(folder: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(p for p in folder.rglob("*") if p.is_file()):
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
    assert 0 < sum(rays) <= plan.num_rays + 64 * plan.num_view_samples
    assert 0 < stored <= 1.1 * plan.store_bytes + 1_000_000
    assert plan.peak_bytes > 0


def test_plan_is_pure(method: TransferMethod, scene: Scene, recipe: Recipe) -> None:
    assert method.plan(scene, recipe) == method.plan(scene, recipe)
    assert json.loads(json.dumps(method.attributes(scene, recipe))) == method.attributes(scene, recipe)


@pytest.mark.parametrize(
    "changes", [{"views": ("nowhere",)}, {"views": ()}, {"num_lights": 10**9}, {"num_lights": 0}, {"size": (0, 0)}]
)
def test_recipe_that_does_not_fit_is_refused_by_the_plan(
    method: TransferMethod, scene: Scene, changes: dict[str, object]
) -> None:
    fields = {"method": method.name, "views": ("front",), "size": SIZE, "num_lights": NUM_LIGHTS, **changes}
    with pytest.raises(PlanError):
        method.plan(scene, Recipe(**fields))  # type: ignore[arg-type]


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


@pytest.mark.parametrize(("backwards", "twice"), [(True, False), (False, True)], ids=["backwards", "twice"])
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
    with pytest.raises((RelumeError, LookupError, StopIteration, ValueError)):
        method.compute(scene, recipe, Task(len(method.stages) - 1, 0, "no such view", 0, 1), open_store(baked))
