"""A fast transfer method with fake results and configurable failures, and a scene of one triangle."""

import errno
import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.assets.environments.environment import Environment
from relume.scene.model import Camera, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput

SHARD, CHUNK, TAIL = 64, 16, 10
RECIPE = Recipe("fake", ("front", "left"), (16, 32), 24)


def tiny_scene(name: str = "triangle") -> Scene:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    normals = np.tile(np.array([[0, 0, 1]], np.float32), (3, 1))
    zeros = np.zeros((3, 4), np.float32)
    mesh = Mesh("m", positions, normals, zeros, zeros[:, :2].copy(), np.array([[0, 1, 2]], np.uint32), 0)
    material = Material("Paper", ({"model": "lambert", "color": [0.5, 0.5, 0.5]},))
    cameras = [Camera(view, np.eye(4), 0.8) for view in ("front", "left")]
    return make_scene(name, [mesh], [material], cameras, Environment("gray", np.ones((4, 8, 3), np.float32)))


@dataclass(frozen=True)
class FakeMethod:
    """Each view has width × height + 10 view samples; each sample, one byte per light.

    Attributes:
        num_rays: claimed by the plan; selects this process or the cluster.
        delay_s: how long a task takes. log: a file that gets one line per task computed.
        kill: task index whose process dies: "once" (recorded by a marker beside `log`) or "always".
        problem: raised by the third task: "disk full", "defect", "memory".
    """

    name: str = "fake"
    num_rays: int = 1000
    delay_s: float = 0.0
    log: str = ""
    kill: str = ""
    problem: str = ""
    peak_bytes: int = 1000
    store_bytes: int = 1000
    lone_bytes: int = 0
    stages: tuple[str, ...] = ("samples", "visibility")

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        samples = self._rows(recipe) * len(recipe.views)
        return Plan(samples, self.num_rays, self.store_bytes, self.peak_bytes, self.lone_bytes)

    def prepare(self, scene: Scene) -> None:
        pass

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        return {"method": self.name, "scene": scene.id, "views": list(recipe.views)}

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        if stage == 0:
            return []
        return [
            ArraySpec(
                f"views/{i}/visibility",
                (store.shape(f"views/{i}/depth")[0], recipe.num_lights),
                "uint8",
                (CHUNK, recipe.num_lights),
                (SHARD, recipe.num_lights),
            )
            for i in range(len(recipe.views))
        ]

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        if stage == 0:
            return [Task(0, i, view, 0, self._rows(recipe)) for i, view in enumerate(recipe.views)]
        pieces = [
            (view, start, min(start + SHARD, store.shape(f"views/{i}/depth")[0]))
            for i, view in enumerate(recipe.views)
            for start in range(0, store.shape(f"views/{i}/depth")[0], SHARD)
        ]
        return [Task(1, index, *piece) for index, piece in enumerate(pieces)]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> TaskOutput:
        time.sleep(self.delay_s)
        self._misbehave(task)
        i, rows = recipe.views.index(task.group), task.stop - task.start
        random = np.random.default_rng([int(scene.id, 16), task.stage, task.index])
        if self.log:
            with Path(self.log).open("a") as log:
                log.write(f"{task.stage}.{task.index}\n")
        if task.stage == 0:
            return TaskOutput({f"views/{i}/depth": random.random(rows, np.float32)}, 10, 0.0)
        depth = store.read(f"views/{i}/depth", task.start, task.stop)
        bits = random.integers(0, 256, (rows, recipe.num_lights), np.uint8)
        bits[depth > 0.7] = 0
        return TaskOutput({f"views/{i}/visibility": bits}, self.num_rays // 18, self.delay_s)

    def _rows(self, recipe: Recipe) -> int:
        return recipe.size[0] * recipe.size[1] + TAIL

    def _misbehave(self, task: Task) -> None:
        if (task.stage, task.index) != (1, 3):
            return
        if self.problem == "disk full":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if self.problem == "defect":
            raise ZeroDivisionError("one over nothing")
        if self.problem == "memory":
            raise MemoryError
        marker = Path(self.log + ".died")
        if self.kill == "always" or (self.kill == "once" and not marker.exists()):
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
