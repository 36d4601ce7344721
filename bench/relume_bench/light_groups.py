"""lights.groups_ms: a frame while the fader of a light group moves; lights.groups_rmse_…: a thousand lights in thirty
sources against brute force.

The Cornell box under 1,000 point lights, or 10,000, without an environment. Each of 30 sources has the lights of one
color; sources of more lights than samples are stratified. The fader is of a group of ten sources.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from relume.assets.environments.environment import Environment
from relume.core.cache import Cache
from relume.core.import_warnings import ImporterWarning
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import Look, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.scene.collect_lights import LightCollector
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.until_exact import run_until_exact

_MS = "lights.groups_ms"
_NUM_LIGHTS = {_MS: 1000, "lights.groups_rmse_1000": 1000, "lights.groups_rmse_10000": 10_000}
_NUM_TINY = 100
_NUM_SOURCES = 30


def measure(tiny: bool, name: str) -> list[Figure]:
    """Time of a frame, or an error. name: of the figure"""
    num_lights = _NUM_TINY if tiny else _NUM_LIGHTS[name]
    with tempfile.TemporaryDirectory() as folder:
        if name == _MS:
            return [_fader(Path(folder), num_lights, tiny)]
        return [_error(Path(folder), name, num_lights, tiny)]


def _many_lights(num_lights: int) -> Scene:
    """The Cornell box with point lights below its ceiling, merged as the importer does."""
    room, rng, warnings = cornell_box(), np.random.default_rng(0), list[ImporterWarning]()
    collector = LightCollector(warnings)
    for k in range(num_lights):
        position = rng.uniform((-0.9, 1.3, -0.9), (0.9, 1.9, 0.9)).tolist()
        color = 0.5 + 0.5 * np.sin(k % _NUM_SOURCES + np.arange(3))
        name = collector.name(f"Light {chr(65 + k % _NUM_SOURCES)}.{k:05}")
        collector.add(name, {"kind": "point", "position": position}, color * rng.uniform(0.5, 1.5) * 3 / num_lights)
    materials = collector.emissive_light(room.materials, [np.zeros(3)] * len(room.materials), room.meshes)
    night = Environment("night", np.full((4, 8, 3), 1e-7, np.float32))
    return make_scene("lights", room.meshes, materials, room.cameras, night, warnings, lights=collector.lights)


def _look(default: dict[str, Any], fader: float = 1.0) -> Look:
    group = {"lights": list(default["lights"])[:10], "intensity": fader}
    return validate({"environment": {"intensity": 0.0}, "light_groups": {"Fader": group}}, default)


def _error(folder: Path, name: str, num_lights: int, tiny: bool) -> Figure:
    """Relative RMSE of direct light against brute force, which samples every light singly."""
    scene, side = _many_lights(num_lights), 24 if num_lights <= 1000 else 12  # brute force takes minutes
    size = (side, side)
    recipe = Recipe("direct", ("front",), size, 20)
    store = bake_in_process(METHODS["direct"], scene, recipe, folder / f"{name}.zarr")
    transfer = open_transfer(store, Cache(4 << 30))
    look = _look(transfer.default_look)
    image = render_image(transfer, "front", look).astype(np.float64)
    reference = reference_image(scene, "front", look, size, 1)
    rmse = float(np.sqrt(((image - reference) ** 2).mean() / (reference**2).mean()))
    bias = float(image.sum() / reference.sum() - 1)
    context = {"size": list(size), "lights": num_lights, "sources": len(scene.lights), "bias": bias}
    return Figure(name, rmse, "relative RMSE", context)


def _fader(folder: Path, num_lights: int, tiny: bool) -> Figure:
    """Time frames of an image with indirect light while a fader moves, including encoding."""
    scene, (size, method) = _many_lights(num_lights), ((32, 32), "direct") if tiny else ((400, 400), "gather")
    recipe = Recipe(method, ("front",), size, 20)
    transfer = open_transfer(bake_in_process(METHODS[method], scene, recipe, folder / "fader.zarr"), Cache(4 << 30))
    picture, durations = Picture(transfer, "front", Cache(1 << 30)), []
    for k in range(5 if tiny else 60):
        picture.set_look(_look(transfer.default_look, 1 + k / 60), active_pointer="/light_groups/Fader")
        start_time = time.perf_counter()
        if k > 0:  # the first shades all lights, and the group alone
            picture.encode(picture.advance(None).tiles, "rgb9e5")
            durations.append(1000 * (time.perf_counter() - start_time))
        run_until_exact(picture)
    context = {"size": list(size), "method": method, "lights": num_lights, "sources": len(scene.lights)}
    return Figure(_MS, float(np.median(durations)), "ms", context)
