"""bake.two_workers_speedup: the same bake with one worker process and with two, each with one thread.

The start of the cluster is excluded: a smaller bake runs first in the same service. The time is from submitting to
`ready`, including scheduling, store and publishing.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from relume.core.errors import PlanError
from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure
from relume_worker.executor import num_cores
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService


def bake_s(service: BakeService, scene: str, recipe: Recipe) -> float:
    """Seconds from submitting a bake to `ready`.

    Args:
        service: service of the bake. scene: id of a registered one. recipe: recipe of the bake.
    Raises:
        PlanError: the bake has failed.
    """
    start_time = time.perf_counter()
    identity = service.submit(scene, recipe)
    with service.subscribe(identity) as changes:
        last = list(changes)[-1]
    if last.state != "ready":
        raise PlanError(f"the bake {last.state}: {last.problem}; see the log")
    return time.perf_counter() - start_time


def measure(tiny: bool) -> list[Figure]:
    """Time the same bake with one worker process, then with two."""
    scene = demo_scene()
    views = tuple(camera.name for camera in scene.cameras)
    warm = Recipe("direct", views, (320, 240), 500 if not tiny else 8)
    recipe = Recipe("direct", views, (64, 48) if tiny else (640, 480), 60 if tiny else 2000)
    durations = {}
    for processes in (1, 2):
        with tempfile.TemporaryDirectory() as folder, BakeService(Path(folder), num_workers=processes) as service:
            register_scene(service.data_dir, service.ledger, scene)
            bake_s(service, scene.id, warm)
            durations[processes] = bake_s(service, scene.id, recipe)
    context = {
        "one_s": durations[1],
        "two_s": durations[2],
        "size": list(recipe.size),
        "views": len(views),
        "lights": recipe.num_lights,
        "cores": num_cores(),
        "runs_in": "the service's own process, too small for a cluster" if tiny else "worker processes",
    }
    return [Figure("bake.two_workers_speedup", durations[1] / durations[2], "ratio", context)]
