"""bake.wall_vs_rays and bake.teatray_s: whole bakes of the built-in scene in one process, with all threads.

The first is the total wall time (environment triangles, view samples, tracing, store, publishing) ÷ the seconds in
which the kernels of the visibility stage trace and predict, at 640×480 and 2,000 lights. The second is the wall time at
the size of Ben-Artzi's Teatray (66,867 pixels, 4,000 triangles), whose precomputation takes 17 minutes in his table 1;
the scene is our still life, modeled after it, not his data.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from relume.core.thread_pools import num_threads
from relume.methods.direct import DirectMethod
from relume.methods.store_layout import read_rays
from relume.scene.examples.still_life import demo_scene
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe, TaskOutput
from relume.store.reader import open_store
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.timing import seconds


def measure(tiny: bool) -> list[Figure]:
    """Time two bakes, after a small one that compiles."""
    scene = demo_scene()
    with tempfile.TemporaryDirectory() as folder:
        _bake(scene, (32, 24), 30, Path(folder) / "warm.zarr")
        wall_s, large = _bake(scene, (64, 48) if tiny else (640, 480), 60 if tiny else 2000, Path(folder) / "1.zarr")
        # slightly fewer pixels than samples: silhouettes have two or three per pixel
        teatray_s, teatray = _bake(
            scene, (64, 48) if tiny else (296, 222), 60 if tiny else 4000, Path(folder) / "2.zarr"
        )
    return [
        Figure("bake.wall_vs_rays", wall_s / large["tracing_s"], "ratio", large),
        Figure("bake.teatray_s", teatray_s, "s", teatray),
    ]


def _bake(scene: Scene, size: tuple[int, int], num_lights: int, target: Path) -> tuple[float, dict[str, Any]]:
    """Return the wall time of a bake, and its context."""
    written: list[TaskOutput] = []
    recipe = Recipe("direct", ("front",), size, num_lights)
    wall_s = seconds(
        lambda: bake_in_process(DirectMethod(), scene, recipe, target, lambda _, record: written.append(record))
    )
    store = open_store(target)
    trace_s, rays = sum(record.trace_s for record in written), read_rays(store)
    return wall_s, {
        "wall_s": wall_s,
        "tracing_s": trace_s,
        "rays": rays.num_traced,
        "rays_per_s": rays.num_traced / trace_s,
        "full_trace": rays.num_full,
        "samples": store.shape("views/0/pixel")[0],
        "size": list(size),
        "lights": num_lights,
        "threads": num_threads(),
    }
