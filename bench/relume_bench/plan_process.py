"""Bake a saved scene like a worker process, and report its cost.

`python -m relume_bench.plan_process FOLDER RECIPE`.

RECIPE is JSON from `relume_worker.status.recipe_json`. Prints one line of JSON: peak memory in bytes, view samples,
rays, bytes of the store's arrays. Linux only, because of the peak memory.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import distributed.worker  # noqa: F401  a worker process holds it too

from relume.methods.registry import METHODS
from relume.scene.scene_folder import load_scene
from relume.store.bake_protocol import Task, TaskOutput
from relume.store.publish import array_paths
from relume.store.reader import open_store
from relume.store.run_bake import bake_in_process
from relume_worker.status import FREE_CAMERA_METHODS, recipe_from_json


def main(folder: str, recipe: str) -> None:
    """Bake, inspect the store, print."""
    planned_recipe, rays = recipe_from_json(recipe), 0

    def count(_: Task, written: TaskOutput) -> None:
        nonlocal rays
        rays += written.num_rays

    with tempfile.TemporaryDirectory() as target:
        scene = load_scene(folder)
        store = bake_in_process(METHODS[planned_recipe.method], scene, planned_recipe, Path(target) / "s.zarr", count)
        peak_bytes = _peak_bytes()
        reader = open_store(store)
        view_arrays = [f"views/{k}/pixel" for k in range(len(planned_recipe.views))]
        sample_arrays = ["probes/material"] if planned_recipe.method in FREE_CAMERA_METHODS else view_arrays
        samples = sum(reader.shape(path)[0] for path in sample_arrays)
        store_bytes = sum(reader.read(path).nbytes for path in array_paths(store))
    print(json.dumps({"peak_bytes": peak_bytes, "view_samples": samples, "rays": rays, "store_bytes": store_bytes}))


def _peak_bytes() -> int:
    """Peak memory of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM:"))


if __name__ == "__main__":
    main(*sys.argv[1:])
