"""A scene, and an opened bake of it for each registered method."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from furnace_method import FurnaceMethod, FurnaceViews
from subdivided_shading import shade_with_projector
from watched_bakes import Bake, Done

from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import CameraMode, OpenBake
from relume.live.opened.openers import OPENERS, open_bake
from relume.methods.registry import METHODS
from relume.scene.model import Camera, Environment, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import BakeMethod, Recipe
from relume.store.run_bake import bake_in_process
from relume_worker.status import FREE_CAMERA_METHODS

__all__ = ["shade_with_projector"]  # a fixture

SIZE, NUM_LIGHTS, NUM_POINTS = (48, 36), 100, 6000


def _quad(name: str, corners: list[list[float]], material: int) -> Mesh:
    positions = np.array(corners, np.float32)
    normal = np.cross(positions[1] - positions[0], positions[2] - positions[0])
    normals = np.tile((normal / np.linalg.norm(normal)).astype(np.float32), (4, 1))
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh(name, positions, normals, np.zeros((4, 4), np.float32), np.zeros((4, 2), np.float32), faces, material)


@pytest.fixture(scope="session")
def scene() -> Scene:
    """A floor and a wall that shadows it, a name with special characters, two views, and a light from one side."""
    floor = _quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    wall = _quad("wall", [[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]], 1)
    glossy = {"model": "blinn_phong", "color": [0.2, 0.2, 0.2], "params": {"exponent": 20.0}}
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
    radiance[:6, 3:7] += 22
    return make_scene("contract", [floor, wall], materials, cameras, Environment("side", radiance))


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize over all methods; `transfer` takes those with fixed cameras, `free_bake` the others."""
    if "method" not in metafunc.fixturenames:
        return
    fixed, names = {*METHODS, FurnaceMethod.name} - FREE_CAMERA_METHODS, {*METHODS, FurnaceMethod.name}
    if "free_bake" in metafunc.fixturenames:
        names = FREE_CAMERA_METHODS
    elif "transfer" in metafunc.fixturenames:
        names = fixed
    # edits behave the same for the tests' own method: it takes all of them with the slow tests
    long = {FurnaceMethod.name} if "edit" in metafunc.fixturenames else set()
    marked = [pytest.param(name, marks=[pytest.mark.slow] * (name in long)) for name in sorted(names)]
    metafunc.parametrize("method", marked, indirect=True, scope="session")


@contextmanager
def _furnace_registered() -> Iterator[None]:
    """Register the tests' own method with the same lines as the others; tests outside this folder must not meet it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(METHODS, FurnaceMethod.name, FurnaceMethod())
        patch.setitem(OPENERS, FurnaceMethod.name, FurnaceViews.from_store)
        yield


@pytest.fixture(scope="module", autouse=True)
def furnace_registered() -> Iterator[None]:
    """The tests' own method is registered for the modules of this folder."""
    with _furnace_registered():
        yield


@pytest.fixture(scope="session")
def method(request: pytest.FixtureRequest) -> BakeMethod:
    """A method, or the tests' own."""
    with _furnace_registered():
        return METHODS[request.param]


@pytest.fixture(scope="session")
def recipe(method: BakeMethod, scene: Scene) -> Recipe:
    return Recipe(method.name, tuple(camera.name for camera in scene.cameras), SIZE, NUM_LIGHTS, num_probes=NUM_POINTS)


@pytest.fixture(scope="session")
def watched(method: BakeMethod, scene: Scene, recipe: Recipe, tmp_path_factory: pytest.TempPathFactory) -> Bake:
    """An undisturbed bake with a record of its tasks."""
    done: list[Done] = []
    store = tmp_path_factory.mktemp("contract") / "store.zarr"
    bake_in_process(
        method, scene, recipe, store, lambda task, rows: done.append(Done(task, tuple(rows.arrays), rows.num_rays))
    )
    return Bake(store, done)


@pytest.fixture(scope="session")
def baked(watched: Bake) -> Path:
    """The store of the undisturbed bake."""
    return watched.store


@pytest.fixture(scope="session")
def opened(baked: Path) -> OpenBake:
    """The bake, opened."""
    with _furnace_registered():
        return open_bake(baked, Cache(1 << 30))


@pytest.fixture(scope="session")
def transfer(opened: OpenBake) -> OpenBake:
    """An opened bake with fixed cameras."""
    assert opened.camera_mode is CameraMode.FIXED
    return opened


@pytest.fixture(scope="session")
def free_bake(opened: OpenBake) -> OpenBake:
    """An opened bake with a free camera."""
    assert opened.camera_mode is CameraMode.FREE
    return opened


@pytest.fixture
def moved_camera(free_bake: OpenBake) -> Camera:
    """A camera that is not in the bake."""
    first = free_bake.views["front"].camera
    to_world = first.to_world.copy()
    to_world[:3, 3] += [0.4, 0.3, -0.2]
    return Camera("front", to_world, first.yfov)
