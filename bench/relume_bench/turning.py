"""turning.*: pictures while the environment turns, against the exact ones.

The built-in scene at 640×480, 1,000 lights, of direct and of all light, its environment turned to 50° in five steps.
`turning.fps`: 1 ÷ the median time from a look to the encoded picture, of the slower light. `turning.error`: relative
RMSE of the last picture against the exact one, the larger of both; `turning.polished_error`: the same with a teapot of
metal of roughness 0.1. The contexts have both lights, and the time of the exact picture.
"""

from __future__ import annotations

import copy
import tempfile
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod
from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import BakeMethod, Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.points import relative_rmse
from relume_bench.timing import seconds
from relume_bench.until_exact import run_until_exact

_CACHE_BYTES = 4 << 30
_POINTER = "/environment/rotation"
_POLISHED = {"terms": [{"model": "ggx", "params": {"roughness": 0.1, "f0": [0.95, 0.9, 0.8]}}]}


class _Turning(NamedTuple):
    """Median seconds of a picture while the environment turns, its error, and seconds of the exact one."""

    picture_s: float
    error: float
    exact_s: float


def measure(tiny: bool) -> list[Figure]:
    """Turn the environment in bakes of direct and of all light."""
    size, num_lights = ((64, 48), 60) if tiny else ((640, 480), 1000)
    methods, common = (DirectMethod(), GatherMethod()), {"size": list(size), "lights": num_lights}
    drags = {method.name: _drag(method, size, num_lights, {}) for method in methods}
    polished = {method.name: _drag(method, size, num_lights, {"Teapot": _POLISHED}) for method in methods}
    context = {**common, **{name: drag._asdict() for name, drag in drags.items()}}
    polished_context = {**common, **{name: drag._asdict() for name, drag in polished.items()}}
    polished_error = 100 * max(drag.error for drag in polished.values())
    return [
        Figure("turning.fps", 1 / max(drag.picture_s for drag in drags.values()), "frames/s", context),
        Figure("turning.error", 100 * max(drag.error for drag in drags.values()), "%", context),
        Figure("turning.polished_error", polished_error, "%", polished_context),
    ]


def _drag(method: BakeMethod, size: tuple[int, int], num_lights: int, materials: dict[str, Any]) -> _Turning:
    """Turn in five steps, then converge. materials: of the look, in place of the scene's"""
    scene = demo_scene()
    view = scene.cameras[0].name
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe(method.name, (view,), size, num_lights)
        path = bake_in_process(method, scene, recipe, Path(folder) / "turned.zarr")
        transfer = open_transfer(path, Cache(_CACHE_BYTES))
        picture = Picture(transfer, view, Cache(_CACHE_BYTES), is_watched=True)
        document = copy.deepcopy(transfer.default_look)
        document["materials"].update(materials)
        picture.set_look(validate(document, transfer.default_look))
        picture.prepare(_POINTER)
        run_until_exact(picture)
        times = [seconds(partial(_turn, picture, transfer, document, angle)) for angle in range(10, 51, 10)]
        turned = picture.image()
        exact_s = seconds(partial(run_until_exact, picture))
        return _Turning(float(np.median(times)), relative_rmse(turned, picture.image()), exact_s)


def _turn(picture: Picture, transfer: FixedViewTransfer, document: dict[str, Any], angle: float) -> None:
    """One step of the drag: the first picture of the new light. document: the look, changed"""
    document["environment"]["rotation"] = float(angle)
    picture.set_look(validate(document, transfer.default_look), active_pointer=_POINTER)
    picture.advance(None)
    picture.run_next_job(lambda share: None, lambda: False)
    picture.encode(picture.advance(None).tiles, "rgb9e5")
