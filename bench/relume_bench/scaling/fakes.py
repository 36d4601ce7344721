"""Stand-ins with realistic bytes and processor time: a library of made-up pictures, and bakes whose tasks sleep."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from relume.assets.environments.environment import Environment
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.picture import Progress
from relume.live.fixed_camera.protocols import CameraMode, EditAxis
from relume.look import default_look
from relume.scene.model import Camera, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput
from relume.store.reader import open_store
from relume_server.runtime.protocols import Library
from relume_server.settings import Settings
from relume_worker.executor import Executors
from relume_worker.jobs.step import IsNeeded, ProgressCallback, Step
from relume_worker.service import BakeService

SIZE = (640, 480)
TILE = 64
CHANGED_TILES = 24
"""Tiles of an edit's frame: an object that fills 30 % of the picture."""
SLIDER = "/materials/Paper/terms/1/params/sigma"


@lru_cache(maxsize=1)
def _triangle() -> Mesh:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    normals = np.tile(np.array([[0, 0, 1]], np.float32), (3, 1))
    zeros = np.zeros((3, 4), np.float32)
    return Mesh("m", positions, normals, zeros, zeros[:, :2].copy(), np.array([[0, 1, 2]], np.uint32), 0)


def small_scene(number: int) -> Scene:
    """One triangle; scenes of different numbers have different ids."""
    terms = (
        {"model": "lambert", "color": [0.5, 0.5, round(number / 65536, 6)]},
        {"model": "cook_torrance", "color": [1.0, 1.0, 1.0], "params": {"sigma": 0.2, "ior": 1.5, "extinction": 0.0}},
    )
    environment = Environment("gray", np.ones((4, 8, 3), np.float32))
    return make_scene(
        f"scene {number}", [_triangle()], [Material("Paper", terms)], [Camera("front", np.eye(4), 0.8)], environment
    )


@dataclass(frozen=True)
class SleepingMethod:
    """A bake of some tasks that sleep, and write a shard each.

    Attributes:
        num_tasks: tasks of a bake. task_s: seconds of a task. shard_bytes: bytes that it writes.
        num_rays: of the plan; above `relume_worker.executor.TINY_BAKE_RAYS` a bake is not tiny.
    """

    num_tasks: int = 1
    task_s: float = 0.0
    shard_bytes: int = 4096
    num_rays: int = 100
    name: str = "direct"
    stages: tuple[str, ...] = ("samples",)

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        return Plan(recipe.size[0] * recipe.size[1], self.num_rays, 1000, 1000)

    def prepare(self, scene: Scene) -> None:
        pass

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        return {"method": self.name, "scene": scene.id, "views": list(recipe.views), "size": list(recipe.size)}

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        """See `BakeMethod`."""
        num = self.shard_bytes // 4
        return [ArraySpec("values", (num * self.num_tasks,), "float32", (num,), (num,))]

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        """See `BakeMethod`."""
        num = self.shard_bytes // 4
        return [Task(0, index, "", index * num, (index + 1) * num) for index in range(self.num_tasks)]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> TaskOutput:
        """See `BakeMethod`."""
        time.sleep(self.task_s)
        return TaskOutput({"values": np.full(self.shard_bytes // 4, task.index, np.float32)}, 10, 0.0)


class ThreadExecutors(Executors):
    """A worker machine whose processes are threads: they sleep, so they need no core.

    Args:
        num_threads: tasks at a time.
    """

    def __init__(self, num_threads: int) -> None:
        super().__init__(None, num_threads)
        self._threads = ThreadPoolExecutor(num_threads, "relume-simulated-worker")

    def cluster(self, kind: str = "bulk") -> Executor:
        return self._threads

    @property
    def has_cluster(self) -> bool:
        return True

    @contextmanager
    def keep_cluster(self) -> Iterator[None]:
        yield

    def close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        super().close()


def open_idle_bakes(settings: Settings) -> BakeService:
    """The bake service of a simulated server: it looks for bakes like any other, and leaves all to the farm."""
    service = BakeService(settings.data, settings.database_url, methods={"direct": SleepingMethod()})
    service.kind.has_room = lambda work, running: False  # type: ignore[method-assign]
    return service


def burn(seconds: float) -> None:
    """Spend processor time without the interpreter lock, as kernels do."""
    buffer = _buffers.array
    until = time.thread_time() + seconds
    while time.thread_time() < until:
        np.add(buffer, np.float32(1), out=buffer)


class _Buffers(threading.local):
    """Memory of each thread for `burn`."""

    def __init__(self) -> None:
        self.array = np.zeros(1 << 14, np.float32)


_buffers = _Buffers()


@dataclass(frozen=True)
class _View:
    name: str
    width: int
    height: int
    camera: Camera = field(default_factory=lambda: Camera("front", np.eye(4), 0.8))

    def material_ids(self) -> np.ndarray[Any, Any]:
        return np.zeros((self.height, self.width), np.uint16)


@dataclass
class _Transfer:
    """An open bake."""

    scene_id: str
    views: dict[str, _View]
    default_look: dict[str, Any]
    method: str = "direct"
    material_names: tuple[str, ...] = ("Paper",)
    camera_mode: CameraMode = CameraMode.FIXED

    @property
    def axes(self) -> frozenset[EditAxis]:
        return frozenset([EditAxis.CURVE])


_TILE_BYTES = bytes(TILE * TILE * 4)


@dataclass
class _Picture:
    """A picture whose edits change `CHANGED_TILES` tiles, and cost `frame_s` of a core."""

    transfer: _Transfer
    view: _View
    frame_s: float
    look: Any = None
    is_due: bool = True

    def set_look(self, look: Any, *, active_pointer: str | None, solo: frozenset[str] | None) -> None:
        self.is_due = self.is_due or look is not self.look
        self.look = look

    def look_at(self, region: object) -> None: ...
    def check(self, look: Any) -> None: ...
    def prepare(self, pointer: str) -> None: ...
    def next_job(self) -> None:
        return None

    def advance(self, max_coefficients: int | None) -> Progress:
        tiles = self.all_tiles()[:CHANGED_TILES] if self.is_due else []
        if self.is_due:
            burn(self.frame_s)
        self.is_due = False
        return Progress(tiles, exact=True, fidelity=Fidelity.EXACT, complete=True)

    def all_tiles(self) -> list[tuple[int, int, int, int]]:
        width, height = self.view.width, self.view.height
        return [
            (x, y, min(TILE, width - x), min(TILE, height - y))
            for y in range(0, height, TILE)
            for x in range(0, width, TILE)
        ]

    def encode_alpha(self, tiles: Sequence[tuple[int, int, int, int]]) -> bytes | None:
        return None

    def encode(self, tiles: Sequence[tuple[int, int, int, int]], form: str) -> bytes:
        return b"".join(_TILE_BYTES[: 4 * width * height] for _, _, width, height in tiles)

    def image(self) -> np.ndarray[Any, Any]:
        return np.zeros((self.view.height, self.view.width, 3), np.float32)


def library_opener(frame_s: float) -> Callable[[int, int], Library]:
    """Return what `create_app` takes as `open_library`. frame_s: processor time of a picture's frame."""

    def open_transfer(path: Path) -> Any:
        attributes = open_store(path).attributes
        views = {name: _View(name, *attributes["size"]) for name in attributes["views"]}
        return _Transfer(attributes["scene"], views, default_look(small_scene(0).materials))

    def make_picture(transfer: Any, view: str) -> Any:
        return _Picture(transfer, transfer.views[view], frame_s)

    def refuse(*_: object, **__: object) -> Any:
        raise NotImplementedError("the simulation has no such pictures")

    def open_library(cache_bytes: int, floor_bytes: int) -> Library:
        return Library(
            open_transfer, open_transfer, make_picture, refuse, refuse, refuse, refuse, refuse, refuse,
            lambda transfer: ({}, {}), dict, lambda: 0, lambda stores: None,
        )  # fmt: skip

    return open_library


class SleepingSteps:
    """Steps of jobs that sleep."""

    def __init__(self, *_: object) -> None: ...
    def run(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        """See `RunStep`."""
        time.sleep(float(step.values["seconds"]))
        return {}

    def num_slots(self) -> int:
        return 4

    def close(self) -> None: ...
