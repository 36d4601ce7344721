"""store.bytes_per_view_sample: size on disk of a published store with 4,000 light triangles ÷ its view samples."""

from __future__ import annotations

import tempfile
from pathlib import Path

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.methods.direct import DirectMethod
from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure

_BLOCK = 4096


def measure(tiny: bool) -> list[Figure]:
    """Bake the built-in scene and add up its files, each rounded up to whole blocks of 4 KiB."""
    recipe = Recipe("direct", ("front",), (64, 48) if tiny else (480, 360), 100 if tiny else 4000)
    with tempfile.TemporaryDirectory() as folder:
        path = bake_in_process(DirectMethod(), demo_scene(), recipe, Path(folder) / "s.zarr")
        view = open_transfer(path, Cache(4 << 30)).views["front"]
        sizes = [file.stat().st_size for file in path.rglob("*") if file.is_file()]
    on_disk = sum(-(-size // _BLOCK) * _BLOCK for size in sizes)
    context = {
        "view_samples": view.num_view_samples,
        "on_surfaces": view.num_surface_samples,
        "content_bytes": sum(sizes),
        "files": len(sizes),
        "size": list(recipe.size),
        "lights": recipe.num_lights,
    }
    return [Figure("store.bytes_per_view_sample", on_disk / view.num_view_samples, "bytes", context)]
