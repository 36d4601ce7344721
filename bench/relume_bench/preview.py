"""preview.*: previews of a rotated environment from few samples, against shading all of them.

The built-in scene at 640×480, 1,000 lights, the environment rotated to 50°. `preview.speedup`: time of shading all
materials ÷ the median preview on the way there; `preview.error`: relative RMSE of the last preview against the shaded
image. The first preview, which chooses the samples, is in the context.
"""

from __future__ import annotations

import copy
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.direct import DirectMethod
from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.points import relative_rmse
from relume_bench.timing import seconds


def measure(tiny: bool) -> list[Figure]:
    """Rotate in five steps, then converge."""
    size, num_lights = ((64, 48), 60) if tiny else ((640, 480), 1000)
    scene = demo_scene()
    view = scene.cameras[0].name
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe("direct", (view,), size, num_lights)
        transfer = open_transfer(
            bake_in_process(DirectMethod(), scene, recipe, Path(folder) / "s.zarr"), Cache(4 << 30)
        )
        picture = Picture(transfer, view, Cache(4 << 30))
        _run_until_exact(picture)
        first, *preview_times = [
            seconds(partial(_rotate_environment, picture, transfer, angle)) for angle in range(10, 51, 10)
        ]
        preview = picture.image()
        whole = seconds(partial(_run_until_exact, picture))
        error = relative_rmse(preview, picture.image())
    context = {
        "size": list(size),
        "view_samples": transfer.views[view].num_surface_samples,
        "first_s": first,
        "preview_s": float(np.median(preview_times)),
        "all_s": whole,
    }
    return [
        Figure("preview.speedup", whole / float(np.median(preview_times)), "ratio", context),
        Figure("preview.error", error, "relative RMSE", {"size": list(size)}),
    ]


def _rotate_environment(picture: Picture, transfer: FixedViewTransfer, angle: float) -> None:
    """One step of the drag: the preview alone."""
    document = copy.deepcopy(transfer.default_look)
    document["environment"]["rotation"] = float(angle)
    picture.set_look(validate(document, transfer.default_look))
    picture.run_next_job(lambda share: None, lambda: False)
    picture.advance(None)


def _run_until_exact(picture: Picture) -> None:
    while not picture.advance(None).exact or picture.next_job() is not None:
        if picture.next_job() is not None:
            picture.run_next_job(lambda share: None, lambda: False)
