"""btf.edit_ms: time to edit a BTF at a fixed view.

The still life at 640×480 in direct light, all surfaces covered with the weave: from an edit of its repetition to the
exact image. `shaded` is the image from nothing, including the incident light, which is cached for edits.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from relume.assets.btf.btf_store import STORE, BtfRecord
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import Look, validate
from relume.methods.registry import METHODS
from relume.scene.examples.catalog import built_in
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.btf_synthetic import SyntheticBtf, open_values_folder
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import run_light_jobs

_BOUND, _SCALE = 0.05, 4.0


def measure(tiny: bool) -> list[Figure]:
    """Cover a still life, and edit the repetition."""
    size, lights, frames = ((40, 30), 100, 3) if tiny else ((640, 480), 1000, 10)
    with (
        open_values_folder(tiny) as values_folder,
        tempfile.TemporaryDirectory() as name,
        STORE.with_search_folder(Path(name) / "btfs"),
    ):
        record, folder = SyntheticBtf("weave", values_folder, tiny).save(Path(name), _BOUND), Path(name)
        scene, recipe = built_in("interior" if tiny else "still_life"), Recipe("direct", ("front",), size, lights)
        transfer = open_transfer(
            bake_in_process(METHODS["direct"], scene, recipe, folder / "held.zarr"), Cache(4 << 30)
        )
        picture = Picture(transfer, "front", Cache(4 << 30))
        shaded_s = _edit_s(picture, _override_with_btf(transfer, record, scale=_SCALE))
        repeats = [_override_with_btf(transfer, record, scale=_SCALE + 0.1 * k) for k in range(1, frames)]
        drag_ms = 1e3 * float(np.median([_edit_s(picture, look) for look in repeats]))
    context = {"size": f"{size[0]}×{size[1]}", "lights": lights, "every_surface": "woven"}
    return [Figure("btf.edit_ms", drag_ms, "ms", {**context, "shaded": 1e3 * shaded_s})]


def _override_with_btf(transfer: FixedViewTransfer, record: BtfRecord, **params: float) -> Look:
    terms = [{**record.terms()[0], "params": params}]
    return validate({"materials": {name: {"terms": terms} for name in transfer.material_names}}, transfer.default_look)


def _edit_s(picture: Picture, look: Look) -> float:
    start_time = time.perf_counter()
    picture.set_look(look)
    picture.advance(None)
    run_light_jobs(picture)
    return time.perf_counter() - start_time
