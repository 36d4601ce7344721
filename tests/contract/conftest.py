"""A scene, and for every registered method its bake, opened."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from furnace_method import FurnaceMethod
from subdivided_shading import shade_with_projector
from watched_bakes import Bake, Done

from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import CameraMode, OpenBake
from relume.methods.base import TransferMethod
from relume.methods.registry import METHODS, open_bake
from relume.scene.model import Camera, Environment, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.store import bake_in_process
from relume.store.bake_protocol import Recipe
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
    """A floor and a wall that shadows it, a name that is hard on file names, two views, light from one side."""
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
    """Every registered method, and the tests' own; of those with pictures, the ones whose eyes move or do not."""
    if "method" not in metafunc.fixturenames:
        return
    fixed, names = {*METHODS, FurnaceMethod.name} - FREE_CAMERA_METHODS, {*METHODS, FurnaceMethod.name}
    if "moving" in metafunc.fixturenames:
        names = FREE_CAMERA_METHODS
    elif "transfer" in metafunc.fixturenames:
        names = fixed
    # what a hand does is the same for the tests' own method: it goes through all of it with the long tests
    long = {FurnaceMethod.name} if "edit" in metafunc.fixturenames else set()
    marked = [pytest.param(name, marks=[pytest.mark.slow] * (name in long)) for name in sorted(names)]
    metafunc.parametrize("method", marked, indirect=True, scope="session")


@pytest.fixture(scope="session")
def method(request: pytest.FixtureRequest) -> Iterator[TransferMethod]:
    """One of them; the tests' own joins by the same one line."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(METHODS, FurnaceMethod.name, FurnaceMethod())
        yield METHODS[request.param]


@pytest.fixture(scope="session")
def recipe(method: TransferMethod, scene: Scene) -> Recipe:
    return Recipe(method.name, tuple(camera.name for camera in scene.cameras), SIZE, NUM_LIGHTS, num_probes=NUM_POINTS)


@pytest.fixture(scope="session")
def watched(method: TransferMethod, scene: Scene, recipe: Recipe, tmp_path_factory: pytest.TempPathFactory) -> Bake:
    """An undisturbed bake, and what was done for it."""
    done: list[Done] = []
    store = tmp_path_factory.mktemp("contract") / "store.zarr"
    bake_in_process(
        method, scene, recipe, store, lambda task, rows: done.append(Done(task, tuple(rows.arrays), rows.num_rays))
    )
    return Bake(store, done)


@pytest.fixture(scope="session")
def baked(watched: Bake) -> Path:
    """Its store."""
    return watched.store


@pytest.fixture(scope="session")
def opened(baked: Path) -> OpenBake:
    """The bake, opened."""
    return open_bake(baked, Cache(1 << 30))


@pytest.fixture(scope="session")
def transfer(opened: OpenBake) -> OpenBake:
    """A bake of fixed views, opened."""
    assert opened.camera_mode is CameraMode.FIXED
    return opened


@pytest.fixture(scope="session")
def moving(opened: OpenBake) -> OpenBake:
    """A bake whose eyes move, opened."""
    assert opened.camera_mode is CameraMode.FREE
    return opened


@pytest.fixture
def aside(moving: OpenBake) -> Camera:
    """An eye that nobody baked."""
    first = moving.views["front"].camera
    to_world = first.to_world.copy()
    to_world[:3, 3] += [0.4, 0.3, -0.2]
    return Camera("front", to_world, first.yfov)
