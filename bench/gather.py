"""gather.*: what somebody waits who edits a picture with light between surfaces.

The Cornell box under the sky at 400×400 with 2,000 lights and 16,000 gather cells, its floor half glossy. The bake is
in one process with all threads, after a tiny one that compiles. The edit: the exponent of the floor's highlight moves
between 3 and 300, from the look to the encoded bytes, all bounces kept; its operator is frozen once before.
"""

from __future__ import annotations

import copy
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.figure import Figure
from bench.timing import percentiles, seconds
from relume.bake import Recipe, Task, Written
from relume.look import validate
from relume.memory import Memory
from relume.methods.gather import GatherMethod
from relume.methods.registry import open_transfer
from relume.parallel import num_threads
from relume.picture.picture import Picture
from relume.picture.transfer import Transfer
from relume.scene.cornell import cornell_box
from relume.scene.model import Scene
from relume.store import bake_here

_NAMES = ("gather.bake_s", "gather.store_mb", "gather.freeze_s", "gather.brdf_fps")
FLOOR = "/materials/Floor/terms/1"
_SPEED = "frames/s"


class Baked(NamedTuple):
    """A bake, and how it went.

    Attributes:
        wall_s: of it. context: its parts.
    """

    path: Path
    wall_s: float
    context: dict[str, Any]


def measure(tiny: bool) -> list[Figure]:
    """Bake, open, freeze, drag."""
    scene = cornell_box(is_floor_glossy=True)
    with tempfile.TemporaryDirectory() as folder:
        bake(scene, recipe_of(tiny=True), Path(folder) / "warm.zarr")
        baked = bake(scene, recipe_of(tiny), Path(folder) / "gather.zarr")
        size_mb = store_mb(baked.path)
        transfer = open_transfer(baked.path, Memory(4 << 30))
        picture = opened(transfer)
        freezing = _freezing(transfer, picture)
        frames_s = edit_frames_s(transfer, picture, 5 if tiny else 120)
    p50, p95 = percentiles(frames_s)
    followed_s = max(taken for name, taken in freezing.items() if not name.endswith("exact_s"))
    size = {"size": list(recipe_of(tiny).size), "cells": baked.context["cells"]}
    return [
        Figure(_NAMES[0], baked.wall_s, "s", {**baked.context, "threads": num_threads()}),
        Figure(_NAMES[1], size_mb, "MB", {**size, "rays_a_sample": transfer.store.shape("views/0/links")[1]}),
        Figure(_NAMES[2], followed_s, "s", {**size, "floor_samples": _floor_samples(transfer), **freezing}),
        Figure(_NAMES[3], 1 / p50, _SPEED, {**size, "ms_p50": 1e3 * p50, "ms_p95": 1e3 * p95}),
    ]


def recipe_of(tiny: bool) -> Recipe:
    """The recipe that is measured, or, where tiny, one that bakes in a second."""
    return Recipe("gather", ("front",), *(((40, 40), 60) if tiny else ((400, 400), 2000)))


def bake(scene: Scene, recipe: Recipe, target: Path) -> Baked:
    """Bake in this process by the method `gather`.

    Args:
        scene: that is baked. recipe: how.
        target: folder of the store.
    Returns:
        Where the store is, wall seconds, and wall and tracing seconds and rays of every stage.
    """
    method, stages = (
        GatherMethod(),
        {name: {"wall_s": 0.0, "tracing_s": 0.0, "rays": 0} for name in GatherMethod.stages},
    )
    last = time.perf_counter()

    def note(task: Task, written: Written) -> None:
        nonlocal last
        stage, now = stages[GatherMethod.stages[task.stage]], time.perf_counter()
        stage["wall_s"] += now - last
        stage["tracing_s"] += written.trace_s
        stage["rays"] += written.num_rays
        last = now

    wall_s = seconds(lambda: bake_here(method, scene, recipe, target, note))
    cells = open_transfer(target, Memory(4 << 30)).store.shape("cells/material")[0]
    return Baked(target, wall_s, {"cells": cells, "size": list(recipe.size), "lights": recipe.num_lights, **stages})


def store_mb(path: Path) -> float:
    """Content of all files, 10⁶ bytes."""
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file()) / 1e6


def opened(transfer: Transfer) -> Picture:
    """A picture at rest."""
    picture = Picture(transfer, "front", Memory(4 << 30))
    settle(picture)
    return picture


def settle(picture: Picture) -> None:
    """Make all that is lacking."""
    while not picture.advance(None).exact or picture.next_job() is not None:
        if picture.next_job() is not None:
            picture.freeze(lambda share: None, lambda: False)


def _freezing(transfer: Transfer, picture: Picture) -> dict[str, float]:
    """Seconds until the picture follows a hand on the floor's highlight, and until its operators are exact ones.

    Both are made once before, which compiles. The last one made stays the one that the picture follows.
    """
    warm, taken = opened(transfer), dict[str, float]()
    for pointer in ("curves/theta_h", "params/exponent"):
        warm.touch(f"{FLOOR}/{pointer}")
        settle(warm)
        picture.touch(f"{FLOOR}/{pointer}")
        began, name = time.perf_counter(), pointer.rpartition("/")[2]
        picture.freeze(lambda share: None, lambda: False)
        taken[f"{name}_s"] = time.perf_counter() - began
        settle(picture)
        taken[f"{name}_exact_s"] = time.perf_counter() - began
    return taken


def edit_frames_s(transfer: Transfer, picture: Picture, num_frames: int) -> list[float]:
    """Seconds of each frame but the first, from the look to the encoded bytes, while the floor's exponent is dragged.

    Args:
        transfer: the opened bake, with its default look.
        picture: of it, at rest, what a hand needs made before.
        num_frames: looks of the drag.
    """
    taken = []
    for exponent in np.geomspace(3, 300, num_frames):
        document = copy.deepcopy(transfer.default_look)
        document["materials"]["Floor"]["terms"][1]["params"]["exponent"] = float(exponent)
        look = validate(document, transfer.default_look)
        began = time.perf_counter()
        picture.set_look(look)
        picture.encode(picture.advance(None).tiles, "rgb9e5")
        taken.append(time.perf_counter() - began)
    return taken[1:]


def _floor_samples(transfer: Transfer) -> int:
    rows = transfer.views["front"].rows(transfer.material_names.index("Floor"))
    return int(rows.stop - rows.start)
