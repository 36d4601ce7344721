"""plan.*: actual ÷ planned cost of bakes, the maximum over the built-in scenes and real ones.

Each is baked in a process of its own, on one thread, like in worker processes. A fraction above 1 means that the plan
is no upper bound.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from relume.methods.registry import METHODS
from relume.scene.examples.catalog import BUILT_IN
from relume.scene.model import Scene
from relume.scene.scene_folder import save_scene
from relume.scene_io.import_scene import import_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure, skipped
from relume_bench.scenes import shared_data
from relume_worker.executor import SINGLE_THREAD_ENV
from relume_worker.status import recipe_json

_NAMES = ("plan.memory_share", "plan.samples_share", "plan.store_share", "plan.rays_share")
_PLANNED = ("peak_bytes", "num_view_samples", "store_bytes", "num_rays")
_TAKEN = ("peak_bytes", "view_samples", "store_bytes", "rays")
_FILES = ("scenes/*.glb", "scenes/*/*.glb", "scenes/openchessset_gltf/chess_set.gltf", "scenes/meshes/*.ply")


def measure(tiny: bool) -> list[Figure]:
    """Bake all scenes with all methods; the largest fraction of each kind, and its scene."""
    if not Path("/proc/self/status").exists():
        return skipped(_NAMES, "", "only Linux reports the peak memory of a process")
    size, num_lights = ((32, 24), 60) if tiny else ((640, 480), 500)
    ratios: dict[str, list[float]] = {}
    for scene in _make_scenes(tiny):
        for method in sorted(METHODS):
            recipe = Recipe(method, (scene.cameras[0].name,), size, num_lights)
            plan, measured = METHODS[method].plan(scene, recipe), measure_use(scene, recipe)
            ratios[f"{scene.name}, {method}"] = [
                measured[quantity] / getattr(plan, planned) for quantity, planned in zip(_TAKEN, _PLANNED, strict=True)
            ]
    context = {"scenes": len(ratios), "size": list(size), "lights": num_lights}
    figures = []
    for k, name in enumerate(_NAMES):
        largest = max(ratios, key=lambda label: ratios[label][k])
        ratio_by_label = {label: round(values[k], 3) for label, values in ratios.items()}
        figures.append(
            Figure(name, ratios[largest][k], "of the plan", {**context, "most": largest, "shares": ratio_by_label})
        )
    return figures


def measure_use(scene: Scene, recipe: Recipe) -> dict[str, Any]:
    """Cost of a bake in a process of its own; see `relume_bench.plan_process`."""
    with tempfile.TemporaryDirectory() as folder:
        save_scene(scene, folder)
        command = [sys.executable, "-m", "relume_bench.plan_process", folder, recipe_json(recipe)]
        records = subprocess.run(command, env=os.environ | SINGLE_THREAD_ENV, stdout=subprocess.PIPE, check=True)
    answer: dict[str, Any] = json.loads(records.stdout)
    return answer


def _make_scenes(tiny: bool) -> Iterator[Scene]:
    for built_in in list(BUILT_IN.values())[: 1 if tiny else None]:
        yield built_in.make()
    for pattern in () if tiny else _FILES:
        for path in sorted(shared_data().glob(pattern)):
            yield import_scene(path, path.stem)
