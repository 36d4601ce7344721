"""large.*: dragging a curve of a material that fills 1920×1080 pixels, with an operator too large for float32.

A glossy teapot fills the image; its θh curve, all 256 bands, is dragged, and every frame adds all columns.
`large.frame_ms`: look → updated image, median of the edits, columns in 16 bits. In the context also: the subsampled
operator for smaller memory; the time to make each operator; the error of the last frame against the same look shaded
(relative RMSE). `large.frame_ratio`: frames in 16 bits ÷ in float32, at a quarter of the pixels, where both fit.
`large.bytes_ratio`: memory of the operator in 16 bits ÷ in float32.
"""

from __future__ import annotations

import copy
import tempfile
import time
from pathlib import Path
from typing import Any, cast

import numpy as np

from relume.assets.environments.studio import studio
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import Look, validate
from relume.methods.direct import DirectMethod
from relume.operators.linear_operator import operator_bytes
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.points import relative_rmse
from relume_bench.scenes import cook_torrance, teapot_on_table
from relume_bench.until_exact import run_until_exact

_ROOMY, _BANDS = 16 << 30, 256
_ACTIVE_POINTER = "/materials/Teapot/terms/0/curves/theta_h"
_CLOSE = 0.3  # of the camera distance; the teapot fills the image


def measure(tiny: bool) -> list[Figure]:
    """Measure the large image, then a quarter of it."""
    (width, height), num_lights, num_edits = ((48, 27), 40, 2) if tiny else ((1920, 1080), 100, 10)
    scene = teapot_on_table(studio(), (cook_torrance(0.2),), (cook_torrance(0.2),), _CLOSE)

    def dragged(size: tuple[int, int], forms: tuple[str, ...]) -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as folder:
            recipe = Recipe("direct", ("front",), size, num_lights)
            path = bake_in_process(DirectMethod(), scene, recipe, Path(folder) / "s.zarr")
            return _measure_forms(open_transfer(path, Cache(_ROOMY)), forms, num_edits)

    large = dragged((width, height), ("packed", "thin"))
    quarter = dragged((width // 2, height // 2), ("packed", "float32"))
    details = {"size": [width, height], "bands": _BANDS, "lights": num_lights, "edits": num_edits}
    sizes = {form: form_result["bytes"] / (width * height) for form, form_result in large.items()}
    whole = operator_bytes(width * height, _BANDS)  # one sample per pixel, as for a material that fills the image
    sizes["float32"] = whole / (width * height)
    return [
        Figure("large.frame_ms", large["packed"]["ms"], "ms", {**details, **large}),
        Figure("large.frame_ratio", quarter["packed"]["ms"] / quarter["float32"]["ms"], "ratio", quarter),
        Figure("large.bytes_ratio", large["packed"]["bytes"] / whole, "ratio", {"bytes_a_pixel": sizes}),
    ]


def _looks(transfer: FixedViewTransfer, num: int) -> list[Look]:
    """The highlight's curve, higher and narrower from look to look."""
    looks = []
    for k in range(num):
        document = copy.deepcopy(transfer.default_look)
        peak = 1 + 8 * k / num
        curve = {"points": [[0, peak], [30 / peak, 0.3], [90, 0]]}
        document["materials"]["Teapot"]["terms"][0]["curves"] = {"theta_h": curve}
        looks.append(validate(document, transfer.default_look))
    return looks


def _measure_forms(transfer: FixedViewTransfer, forms: tuple[str, ...], num_edits: int) -> dict[str, Any]:
    """Drag with operators of several forms, each with memory for no better one."""
    rows = transfer.views["front"].rows(0)
    num = rows.stop - rows.start
    one_less = (operator_bytes(num, _BANDS, bits) - 1 for bits in (32, 16))
    budgets = dict(zip(("float32", "packed", "thin"), (_ROOMY, *one_less), strict=True))
    looks = _looks(transfer, num_edits)
    last = _open_exact(transfer, looks[-1], Cache(_ROOMY)).image()
    return {form: _measure_edits(transfer, looks, budgets[form], last) for form in forms}


def _measure_edits(transfer: FixedViewTransfer, looks: list[Look], budget_bytes: int, last: Any) -> dict[str, Any]:
    """Drag with the precomputed operator; last: the last look, shaded."""
    cache = Cache(budget_bytes)
    picture = _open_exact(transfer, looks[0], cache)
    picture.prepare(_ACTIVE_POINTER)
    job = picture.next_job()
    assert job is not None
    assert job.kind == "operator"
    start_time = time.perf_counter()
    result = job.run(lambda share: None, lambda: False)
    freeze_s = time.perf_counter() - start_time
    job.apply(result)
    durations = []
    for look in looks[1:]:
        start_time = time.perf_counter()
        picture.set_look(look, active_pointer=_ACTIVE_POINTER)
        picture.advance(None)
        durations.append(time.perf_counter() - start_time)
    return {
        "ms": 1e3 * float(np.median(durations)),
        "freeze_s": freeze_s,
        "error": relative_rmse(picture.image(), last),
        "step": cast("Any", job.run).__self__.form.step,
        "bytes": result.num_bytes,
    }


def _open_exact(transfer: FixedViewTransfer, look: Look, cache: Cache) -> Picture:
    picture = Picture(transfer, "front", cache)
    picture.set_look(look)
    run_until_exact(picture)
    return picture
