"""sharp.clean_s, sharp.drag_fps: edits of the roughness of the metal teapot of `relume_bench.sharp`, 640×480.

The camera is closer, so that the teapot has about 100,000 samples, a third of the image. `sharp.clean_s`: in an exact
image, roughness 0.3 → 0.05 by the prepared slider, until the frame from which on the teapot's display values differ
from those of the exact image by at most 2 % (relative RMS), median of two; `exact_s` is the time of the exact image.
`sharp.drag_fps`: frames per second while
the roughness is dragged from 0.6 to 0.02, from the look to the encoded bytes, after the slider was touched; background
jobs run beside the frames, as in a session.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.thread_pools import num_threads
from relume.image_io.tone_mapping import tone_map
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.look import Look
from relume.scene.examples.catalog import built_in
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Scene
from relume.scene.scene_folder import make_scene
from relume_bench import sharp
from relume_bench.background_jobs import BackgroundJobs
from relume_bench.figure import Figure
from relume_bench.timing import percentiles
from relume_bench.until_exact import run_until_exact

_POINTER = f"/materials/{sharp.MATERIAL}/terms/0/params/roughness"
_FROM, _TO, _SLIDER = 0.3, 0.05, (0.6, 0.02)
_CLEAN = 0.02  # greatest relative RMS difference of a clean frame
_CACHE_BYTES = 4 << 30


def measure(tiny: bool) -> list[Figure]:
    """Measure both on one bake; the first edit and the first drag, in which kernels are loaded, are not counted."""
    with tempfile.TemporaryDirectory() as folder:
        transfer = sharp.bake_and_open(_make_scene(), tiny, Path(folder))
        # no two edits have the same values, because results of edits are cached
        _, *edits = (_time_edit(transfer, 1 + 0.01 * k) for k in range(3))
        clean, exact = zip(*edits, strict=True)
        durations = _time_drag(transfer, 6 if tiny else 120)
    rows = transfer.views[sharp.VIEW].rows(transfer.material_names.index(sharp.MATERIAL))
    context = {
        "size": list(sharp.Sizes.choose(tiny).size), "glossy_samples": int(rows.stop - rows.start),
        "threads": num_threads(),
    }  # fmt: skip
    p50, p95 = percentiles(durations)
    details = {"ms_p50": 1e3 * p50, "ms_p95": 1e3 * p95, "our_roughness": sharp.allowed(_SLIDER[1]), **context}
    return [
        Figure("sharp.clean_s", float(np.median(clean)), "s", {"exact_s": float(np.median(exact)), **context}),
        Figure("sharp.drag_fps", len(durations) / sum(durations), "frames/s", details),
    ]


def _make_scene() -> Scene:
    """The still life with a camera close to the teapot."""
    scene = built_in("still_life")
    camera = look_at(sharp.VIEW, (0.011, 0.289, 0.568), (-0.045, 0.085, -0.03), scene.cameras[0].yfov)
    return make_scene("Teapot of the still life", scene.meshes, scene.materials, [camera], scene.environment)


def _open_exact(transfer: FixedViewTransfer, roughness: float) -> Picture:
    """An exact image with a roughness."""
    picture = Picture(transfer, sharp.VIEW, Cache(_CACHE_BYTES), is_watched=True)
    picture.set_look(sharp.make_look(transfer.default_look, "metal", roughness))
    run_until_exact(picture)
    return picture


def _time_edit(transfer: FixedViewTransfer, scale: float) -> tuple[float, float]:
    """Seconds from the edit to the first clean frame, and to the exact one."""
    picture = _open_exact(transfer, scale * _FROM)
    picture.prepare(_POINTER)
    run_until_exact(picture)
    look = sharp.make_look(transfer.default_look, "metal", scale * _TO)
    pot = transfer.views[sharp.VIEW].material_ids() == transfer.material_names.index(sharp.MATERIAL)
    seconds, shown, is_exact = 0.0, list[tuple[float, NDArray[np.float32]]](), False
    picture.set_look(look, active_pointer=_POINTER)
    while not is_exact:
        start_time = time.perf_counter()
        is_exact = picture.advance(None).exact
        picture.encode(picture.all_tiles(), "rgb9e5")
        seconds += time.perf_counter() - start_time
        shown.append((seconds, tone_map(picture.image(), look.display.exposure, look.display.tone_map)[pot]))
        start_time = time.perf_counter()
        if not is_exact:
            picture.run_next_job(lambda share: None, lambda: False)
        seconds += time.perf_counter() - start_time
    exact = shown[-1][1]
    is_clean = [np.linalg.norm(image - exact) <= _CLEAN * np.linalg.norm(exact) for _, image in shown]
    first = max((k + 1 for k, clean in enumerate(is_clean) if not clean), default=0)
    return shown[first][0], seconds


def _time_drag(transfer: FixedViewTransfer, num_frames: int) -> list[float]:
    """Seconds of each frame of the second drag."""
    picture, durations = _open_exact(transfer, _SLIDER[0]), list[float]()
    picture.prepare(_POINTER)
    run_until_exact(picture)
    for shift in (0.99, 1.0):
        roughness = np.geomspace(shift * _SLIDER[0], sharp.allowed(_SLIDER[1]), num_frames).tolist()
        durations = _show(picture, [sharp.make_look(transfer.default_look, "metal", value) for value in roughness])
    return durations


def _show(picture: Picture, looks: Sequence[Look]) -> list[float]:
    """Seconds of the frame of each look."""
    durations = []
    with BackgroundJobs(picture) as background:
        for look in looks:
            start_time = time.perf_counter()
            background.request()
            picture.set_look(look, active_pointer=_POINTER)
            picture.encode(picture.advance(None).tiles, "rgb9e5")
            durations.append(time.perf_counter() - start_time)
            background.start_next()
    return durations
