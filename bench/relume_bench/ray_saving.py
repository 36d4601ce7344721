"""bake.ray_saving: shadow rays of a full trace ÷ those that the bake traced, and the resulting error.

The built-in scene, one view, baked twice: normally, and with every ray traced. The context has the different bits, the
bake's own estimate of them, the relative RMSE between both images (of the scene's default look and all Lambert), and
the wall time of each bake, also as a multiple of its seconds in the kernels that trace and predict.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.look import complete, validate
from relume.methods.direct import DirectMethod
from relume.methods.store_layout import read_lights, read_rays
from relume.methods.view_stages import SampledViews
from relume.output.render_image import render_image
from relume.raytrace.visibility import trace_visibility
from relume.scene.examples.still_life import demo_scene
from relume.scene.model import Scene
from relume.store.bake_protocol import BakeMethod, Recipe, StoreReader, Task, TaskOutput
from relume.store.reader import open_store
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.points import relative_rmse
from relume_bench.scenes import LAMBERT
from relume_bench.timing import seconds


class _EveryRayViews(SampledViews):
    """Views without predictions."""

    def _visibility(self, scene: Scene, k: int, task: Task, store: StoreReader) -> TaskOutput:
        position = store.read(f"views/{k}/position", task.start, task.stop)
        normal = store.read(f"views/{k}/normal", task.start, task.stop)
        embree = self.geometry_of(scene).embree
        traced = trace_visibility(embree, position, normal, read_lights(store).direction)
        return TaskOutput({f"views/{k}/visibility": traced.visible}, traced.num_rays, traced.trace_s)


class _EveryRay(DirectMethod):
    """A bake without predictions."""

    def __init__(self) -> None:
        super().__init__()
        self._views = _EveryRayViews()


_BAKES: tuple[BakeMethod, ...] = (DirectMethod(), _EveryRay())


def _times(method: BakeMethod, scene: Scene, recipe: Recipe, path: Path) -> tuple[float, float]:
    """Seconds of a whole bake, and those of tracing and predicting."""
    written: list[TaskOutput] = []
    wall_s = seconds(lambda: bake_in_process(method, scene, recipe, path, lambda _, record: written.append(record)))
    return wall_s, sum(record.trace_s for record in written)


def measure(tiny: bool) -> list[Figure]:
    """Bake with predictions and with every ray, and compare two images of each."""
    scene = demo_scene()
    recipe = Recipe("direct", ("front",), (64, 48) if tiny else (640, 480), 60 if tiny else 2000)
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{k}.zarr" for k in range(2)]
        saving, full = (_times(bake, scene, recipe, path) for bake, path in zip(_BAKES, paths, strict=True))
        rays = read_rays(open_store(paths[0]))
        bits = [np.unpackbits(open_store(path).read("views/0/visibility")) for path in paths]
        context = {
            "rays": rays.num_traced,
            "full_trace": rays.num_full,
            "wrong_bits": float(np.count_nonzero(bits[0] != bits[1]) / rays.num_full),
            "estimated_by_the_bake": rays.error_rate,
            **_changes(scene, paths),
            "wall_s": saving[0],
            "wall_s_of_every_ray": full[0],
            "wall_vs_rays": saving[0] / saving[1],
            "wall_vs_rays_of_every_ray": full[0] / full[1],
            "size": list(recipe.size),
            "lights": recipe.num_lights,
        }
    return [Figure("bake.ray_saving", rays.num_full / rays.num_traced, "ratio", context)]


def _changes(scene: Scene, paths: list[Path]) -> dict[str, float]:
    """Relative RMSE between the images of two stores."""
    looks: dict[str, dict[str, Any]] = {
        "own_look_changes_by": {},
        "lambert_changes_by": {"materials": {m.name: {"terms": [LAMBERT]} for m in scene.materials}},
    }
    changes = {}
    for name, partial in looks.items():
        pictures = []
        for path in paths:
            transfer = open_transfer(path, Cache(4 << 30))
            look = validate(complete(partial, transfer.default_look), transfer.default_look)
            pictures.append(render_image(transfer, "front", look))
        changes[name] = relative_rmse(*pictures)
    return changes
