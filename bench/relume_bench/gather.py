"""gather.*: waiting times when editing an image with indirect light.

The Cornell box under the environment at 400×400 with 2,000 lights and 16,000 patches, its floor half glossy. The bake
is in one process with all threads, after a tiny one that compiles. The edit: the exponent of the floor's highlight
moves between 3 and 300, from the look to the encoded bytes, all bounces included; its operator is precomputed.
"""

from __future__ import annotations

import copy
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from relume.core.cache import Cache
from relume.core.thread_pools import num_threads
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.gather import GatherMethod
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe, Task, TaskOutput
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.timing import percentiles, seconds
from relume_bench.until_exact import run_until_exact

_NAMES = ("gather.bake_s", "gather.store_mb", "gather.freeze_s", "gather.brdf_fps")
FLOOR = "/materials/Floor/terms/1"
_SPEED = "frames/s"


class Baked(NamedTuple):
    """A bake, and its cost.

    Attributes:
        wall_s: total. context: its parts.
    """

    path: Path
    wall_s: float
    context: dict[str, Any]


def measure(tiny: bool) -> list[Figure]:
    """Bake, open, freeze, drag."""
    scene = cornell_box(is_floor_glossy=True)
    with tempfile.TemporaryDirectory() as folder:
        bake(scene, make_recipe(tiny=True), Path(folder) / "warm.zarr")
        baked = bake(scene, make_recipe(tiny), Path(folder) / "gather.zarr")
        size_mb = store_mb(baked.path)
        transfer = open_transfer(baked.path, Cache(4 << 30))
        picture = open_exact_picture(transfer)
        freeze_times = _time_freezes(transfer, picture)
        frames_s = edit_frames_s(transfer, picture, 5 if tiny else 120)
    p50, p95 = percentiles(frames_s)
    max_freeze_s = max(taken for name, taken in freeze_times.items() if not name.endswith("exact_s"))
    size = {"size": list(make_recipe(tiny).size), "patches": baked.context["patches"]}
    return [
        Figure(_NAMES[0], baked.wall_s, "s", {**baked.context, "threads": num_threads()}),
        Figure(_NAMES[1], size_mb, "MB", {**size, "rays_a_sample": transfer.store.shape("views/0/gather_hits")[1]}),
        Figure(_NAMES[2], max_freeze_s, "s", {**size, "floor_samples": _floor_samples(transfer), **freeze_times}),
        Figure(_NAMES[3], 1 / p50, _SPEED, {**size, "ms_p50": 1e3 * p50, "ms_p95": 1e3 * p95}),
    ]


def make_recipe(tiny: bool) -> Recipe:
    """The measured recipe, or with `tiny` one that bakes in a second."""
    return Recipe("gather", ("front",), *(((40, 40), 60) if tiny else ((400, 400), 2000)))


def bake(scene: Scene, recipe: Recipe, target: Path) -> Baked:
    """Bake in this process with the method `gather`.

    Args:
        scene: to bake. recipe: recipe of the bake.
        target: folder of the store.
    Returns:
        The store, wall seconds, and wall and tracing seconds and rays of every stage.
    """
    method, stages = (
        GatherMethod(),
        {name: {"wall_s": 0.0, "tracing_s": 0.0, "rays": 0} for name in GatherMethod.stages},
    )
    last = time.perf_counter()

    def note(task: Task, written: TaskOutput) -> None:
        nonlocal last
        stage, current_time = stages[GatherMethod.stages[task.stage]], time.perf_counter()
        stage["wall_s"] += current_time - last
        stage["tracing_s"] += written.trace_s
        stage["rays"] += written.num_rays
        last = current_time

    wall_s = seconds(lambda: bake_in_process(method, scene, recipe, target, note))
    num_patches = open_transfer(target, Cache(4 << 30)).store.shape("patches/material")[0]
    return Baked(
        target, wall_s, {"patches": num_patches, "size": list(recipe.size), "lights": recipe.num_lights, **stages}
    )


def store_mb(path: Path) -> float:
    """Size of all files, 10⁶ bytes."""
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file()) / 1e6


def open_exact_picture(transfer: FixedViewTransfer) -> Picture:
    """A converged image."""
    picture = Picture(transfer, "front", Cache(4 << 30))
    run_until_exact(picture)
    return picture


def _time_freezes(transfer: FixedViewTransfer, picture: Picture) -> dict[str, float]:
    """Seconds until the image follows a drag of the floor's highlight, and until its operators are exact.

    Both are computed once before, which compiles. The last one stays installed.
    """
    warm, durations = open_exact_picture(transfer), dict[str, float]()
    for pointer in ("curves/theta_h", "params/exponent"):
        warm.prepare(f"{FLOOR}/{pointer}")
        run_until_exact(warm)
        picture.prepare(f"{FLOOR}/{pointer}")
        start_time, name = time.perf_counter(), pointer.rpartition("/")[2]
        picture.run_next_job(lambda share: None, lambda: False)
        durations[f"{name}_s"] = time.perf_counter() - start_time
        run_until_exact(picture)
        durations[f"{name}_exact_s"] = time.perf_counter() - start_time
    return durations


def edit_frames_s(transfer: FixedViewTransfer, picture: Picture, num_frames: int) -> list[float]:
    """Seconds of each frame except the first, from the look to the encoded bytes, while the floor's exponent is
    dragged.

    Args:
        transfer: the opened bake, with its default look.
        picture: converged image, with the drag's operator.
        num_frames: looks of the drag.
    """
    durations = []
    for exponent in np.geomspace(3, 300, num_frames):
        document = copy.deepcopy(transfer.default_look)
        document["materials"]["Floor"]["terms"][1]["params"]["exponent"] = float(exponent)
        look = validate(document, transfer.default_look)
        start_time = time.perf_counter()
        picture.set_look(look)
        picture.encode(picture.advance(None).tiles, "rgb9e5")
        durations.append(time.perf_counter() - start_time)
    return durations[1:]


def _floor_samples(transfer: FixedViewTransfer) -> int:
    rows = transfer.views["front"].rows(transfer.material_names.index("Floor"))
    return int(rows.stop - rows.start)
