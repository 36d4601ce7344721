"""plan.disk_ratio: planned ÷ actual disk space of bakes, the largest over scenes and methods.

All built-in scenes and all importable ones of shared/data, with all methods, in one size. A ratio below 1, a plan that
is too small, fails the run.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from relume.core.errors import RelumeError
from relume.core.folder_size import folder_bytes
from relume.methods.disk import estimate_disk
from relume.methods.registry import METHODS
from relume.scene.examples.catalog import BUILT_IN
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure, skipped
from relume_bench.scenes import shared_data

NAME = "plan.disk_ratio"
_FILES = ("scenes/*.glb", "scenes/*/*.glb", "scenes/*/*.gltf", "scenes/meshes/*.ply", "scenes/meshes/*.obj")
_GLASS_FILES = "conformance/**/*.glb"  # those with glass had the worst plans


def measure(tiny: bool) -> list[Figure]:
    """Bake all scenes with all methods; the largest ratio, and its scene."""
    if not tiny and not shared_data().is_dir():
        return skipped((NAME,), "", "the folder of shared scenes is not here: set RELUME_SHARED_DATA")
    size, lights, num_probes = ((64, 48), 60, 2000) if tiny else ((320, 240), 300, 50_000)
    ratios: dict[str, float] = {}
    for scene in _list_scenes(tiny):
        for name, method in sorted(METHODS.items()):
            recipe = Recipe(name, (scene.cameras[0].name,), size, lights, num_probes=num_probes)
            planned = estimate_disk(method, scene, recipe, method.plan(scene, recipe)).store
            with tempfile.TemporaryDirectory() as folder:
                measured_bytes = folder_bytes(bake_in_process(method, scene, recipe, Path(folder) / "s.zarr"))
            ratios[f"{scene.name}, {name}"] = planned / measured_bytes
    largest, smallest = max(ratios, key=ratios.__getitem__), min(ratios, key=ratios.__getitem__)
    if ratios[smallest] < 1:
        raise AssertionError(f"{smallest} takes {1 / ratios[smallest]:.2f} times the planned space")
    context = {"size": list(size), "lights": lights, "probes": num_probes, "bakes": len(ratios), "most": largest}
    smallest_details = {"least": smallest, "least_ratio": round(ratios[smallest], 2)}
    each = {"ratios": {label: round(ratio, 2) for label, ratio in ratios.items()}}
    return [Figure(NAME, ratios[largest], "of what is taken", {**context, **smallest_details, **each})]


def _list_scenes(tiny: bool) -> Iterator[Scene]:
    for built_in in list(BUILT_IN.values())[: 1 if tiny else None]:
        yield built_in.make()
    if tiny:
        return
    for pattern in _FILES:
        for path in sorted(shared_data().glob(pattern)):
            yield from _imported(path)
    for path in sorted(shared_data().glob(_GLASS_FILES)):
        yield from (scene for scene in _imported(path) if any(material.glass for material in scene.materials))


def _imported(path: Path) -> Iterator[Scene]:
    """Yield a scene; none if its file is rejected."""
    try:
        yield import_scene(path, path.stem)
    except RelumeError:
        return
