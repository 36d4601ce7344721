"""gather.interior_bake_s and gather.interior_store_mb: a room lit through one window, 64,000 patches.

800×800 pixels and 2,000 lights, in one process with all threads, after a tiny bake that compiles.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from relume.core.thread_pools import num_threads
from relume.scene.examples.interior import interior
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure
from relume_bench.gather import bake, make_recipe, store_mb

_NAMES = ("gather.interior_bake_s", "gather.interior_store_mb")


def measure(tiny: bool) -> list[Figure]:
    """Time one bake."""
    recipe = make_recipe(tiny=True) if tiny else Recipe("gather", ("front",), (800, 800), 2000)
    with tempfile.TemporaryDirectory() as folder:
        bake(interior(), make_recipe(tiny=True), Path(folder) / "warm.zarr")
        baked = bake(interior(), recipe, Path(folder) / "interior.zarr")
        size_mb = store_mb(baked.path)
    details = {"patches": baked.context["patches"], "size": list(recipe.size)}
    return [
        Figure(_NAMES[0], baked.wall_s, "s", {**baked.context, "threads": num_threads()}),
        Figure(_NAMES[1], size_mb, "MB", details),
    ]
