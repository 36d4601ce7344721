"""store.bytes_per_view_sample: size on disk of a published store with 4,000 light triangles ÷ its view samples."""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench.figure import Figure
from relume.scene.demo import demo_scene
from relume.store import bake_here
from relume.transfer.base import Recipe
from relume.transfer.direct import DirectMethod
from relume.transfer.opened import open_transfer


def measure(tiny: bool) -> list[Figure]:
    """Bake the built-in scene and add up its files, as the disk counts them."""
    recipe = Recipe("direct", ("front",), (64, 48) if tiny else (480, 360), 100 if tiny else 4000)
    with tempfile.TemporaryDirectory() as folder:
        path = bake_here(DirectMethod(), demo_scene(), recipe, Path(folder) / "s.zarr")
        view = open_transfer(path).views["front"]
        files = [file.stat() for file in path.rglob("*") if file.is_file()]
    blocks, content = 512 * sum(file.st_blocks for file in files), sum(file.st_size for file in files)
    context = {
        "view_samples": view.num_view_samples,
        "on_surfaces": view.num_surface_samples,
        "content_bytes": content,
        "size": list(recipe.size),
        "lights": recipe.num_lights,
    }
    return [Figure("store.bytes_per_view_sample", blocks / view.num_view_samples, "bytes", context)]
