"""gather.incremental_error: error of incremental images while a color or the number of bounces is dragged.

The room of `relume_bench.gather`. Its red wall is dragged to blue, its floor to dark gray, and bounces from all to one;
the drag is announced and its operators are ready. The last frame of each drag against the same look shaded, relative
RMSE of the whole image; the worst of the three. In the context also the time of a frame, from the look to the encoded
bytes.
"""

from __future__ import annotations

import copy
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.scene.examples.cornell import cornell_box
from relume_bench.figure import Figure
from relume_bench.gather import bake, make_recipe
from relume_bench.points import relative_rmse
from relume_bench.until_exact import run_until_exact

Document = dict[str, Any]
Edit = Callable[[Document, float], None]

_NAME = "gather.incremental_error"


def measure(tiny: bool) -> list[Figure]:
    """Measure three drags in one bake."""
    recipe, num_frames = make_recipe(tiny), 3 if tiny else 12
    drags: dict[str, tuple[str, Edit]] = {
        "red wall to blue": ("/materials/Red wall/terms/0/color", _make_color_edit("Red wall", [0.06, 0.1, 0.7])),
        "floor to dark gray": ("/materials/Floor/terms/0/color", _make_color_edit("Floor", [0.1, 0.1, 0.1])),
        "all bounces to one": ("/transport/bounces", _bounces),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = bake(cornell_box(is_floor_glossy=True), recipe, Path(folder) / "gather.zarr").path
        transfer = open_transfer(path, Cache(4 << 30))
        drag_results = {
            name: _measure_drag(transfer, pointer, edit, num_frames) for name, (pointer, edit) in drags.items()
        }
    worst = max(drag["error"] for drag in drag_results.values())
    return [Figure(_NAME, worst, "relative RMSE", {**drag_results, "size": list(recipe.size)})]


def _make_color_edit(material: str, target: list[float]) -> Edit:
    def edit(document: Document, fraction: float) -> None:
        term = document["materials"][material]["terms"][0]
        term["color"] = [
            (1 - fraction) * was + fraction * becomes for was, becomes in zip(term["color"], target, strict=True)
        ]

    return edit


def _bounces(document: Document, fraction: float) -> None:
    document["transport"]["bounces"] = round(document["transport"]["bounces"] ** (1 - fraction))


def _measure_drag(transfer: FixedViewTransfer, pointer: str, edit: Edit, num_frames: int) -> dict[str, float]:
    """Error of the last frame, the change that it shows, both relative, and median milliseconds per frame."""
    picture = Picture(transfer, "front", Cache(4 << 30))
    run_until_exact(picture)
    before = picture.image().astype(np.float64)
    picture.prepare(pointer)
    run_until_exact(picture)
    durations = []
    for fraction in np.linspace(0, 1, num_frames + 1)[1:]:
        document = copy.deepcopy(transfer.default_look)
        edit(document, float(fraction))
        look = validate(document, transfer.default_look)
        start_time = time.perf_counter()
        picture.set_look(look)
        picture.encode(picture.advance(None).tiles, "rgb9e5")
        durations.append(time.perf_counter() - start_time)
    incremental = picture.image().astype(np.float64)
    run_until_exact(picture)
    exact = picture.image()
    return {
        "error": relative_rmse(incremental, exact), "changed_by": relative_rmse(before, exact),
        "ms_p50": 1e3 * float(np.median(durations[1:])),
    }  # fmt: skip
