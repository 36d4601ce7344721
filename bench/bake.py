"""bake.wall_vs_rays and bake.teatray_s: the built-in scene at 640×480 and 2,000 lights, in one process.

The first is the wall time of everything (light triangles, view samples, tracing, the store, publishing) ÷ the seconds
that the tracing kernels take, both with all threads. The second is that wall time for one view: the scene is our own
still life after Ben-Artzi's Teatray, whose precomputation his table 1 gives; it is not his data.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench.figure import Figure
from bench.timing import seconds
from relume.parallel import num_threads
from relume.scene.demo import demo_scene
from relume.store import bake_here
from relume.transfer.base import Recipe, Task, Written
from relume.transfer.direct import DirectMethod


def measure(tiny: bool) -> list[Figure]:
    """One bake that counts, after a small one that compiles."""
    scene, method = demo_scene(), DirectMethod()
    recipe = Recipe("direct", ("front",), (64, 48) if tiny else (640, 480), 60 if tiny else 2000)
    written: list[tuple[Task, Written]] = []
    with tempfile.TemporaryDirectory() as folder:
        bake_here(method, scene, Recipe("direct", ("front",), (32, 24), 30), Path(folder) / "warm.zarr")
        wall_s = seconds(
            lambda: bake_here(method, scene, recipe, Path(folder) / "s.zarr", lambda *done: written.append(done))
        )
    trace_s = sum(one.trace_s for _, one in written)
    rays = sum(one.num_rays for _, one in written)
    context = {
        "wall_s": wall_s,
        "tracing_s": trace_s,
        "rays": rays,
        "rays_per_s": rays / trace_s,
        "size": list(recipe.size),
        "lights": recipe.num_lights,
        "threads": num_threads(),
    }
    return [
        Figure("bake.wall_vs_rays", wall_s / trace_s, "ratio", context),
        Figure("bake.teatray_s", wall_s, "s", context),
    ]
