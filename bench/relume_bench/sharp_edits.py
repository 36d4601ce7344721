"""sharp.clean_s, sharp.drag_fps: edits of the roughness of the metal teapot of `relume_bench.sharp`, 640×480.

`sharp.clean_s`: roughness 0.3 → 0.05 in an exact image → exact image encoded, median of three. `sharp.drag_fps`: frames
per second while the roughness is dragged from 0.6 to 0.02, from the look to the encoded bytes, after the slider was
touched; background jobs run beside the frames, as in a session. `glossy_samples` are the samples of the teapot.
"""

from __future__ import annotations

import time

import numpy as np

from relume.core.cache import Cache
from relume.core.thread_pools import num_threads
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume_bench import sharp
from relume_bench.background_jobs import BackgroundJobs
from relume_bench.figure import Figure
from relume_bench.gather import run_until_exact
from relume_bench.timing import percentiles

_POINTER = f"/materials/{sharp.MATERIAL}/terms/0/params/roughness"
_FROM, _TO, _SLIDER = 0.3, 0.05, (0.6, 0.02)
_CACHE_BYTES = 4 << 30


def measure(tiny: bool) -> list[Figure]:
    """Measure both on one bake; the first edit and the first drag, in which kernels are compiled, are not counted."""
    transfer, num_edits, num_frames = sharp.open_still_life(tiny), 2 if tiny else 4, 6 if tiny else 120
    rows = transfer.views[sharp.VIEW].rows(transfer.material_names.index(sharp.MATERIAL))
    context = {
        "size": list(sharp.Sizes.choose(tiny).size), "glossy_samples": int(rows.stop - rows.start),
        "threads": num_threads(),
    }  # fmt: skip
    # no two edits have the same values, because results of edits are cached
    _, *edits = (_time_edit(transfer, 1 + 0.01 * k) for k in range(num_edits))
    _, durations = (_time_drag(transfer, num_frames, 1 - 0.01 * k) for k in range(2))
    p50, p95 = percentiles(durations)
    details = {"ms_p50": 1e3 * p50, "ms_p95": 1e3 * p95, "to": sharp.allowed(_SLIDER[1]), **context}
    return [
        Figure("sharp.clean_s", float(np.median(edits)), "s", {"edits_s": edits, **context}),
        Figure("sharp.drag_fps", len(durations) / sum(durations), "frames/s", details),
    ]


def _open_exact(transfer: FixedViewTransfer, roughness: float) -> Picture:
    """An exact image with a roughness."""
    picture = Picture(transfer, sharp.VIEW, Cache(_CACHE_BYTES), is_watched=True)
    picture.set_look(sharp.make_look(transfer.default_look, "metal", roughness))
    run_until_exact(picture)
    return picture


def _time_edit(transfer: FixedViewTransfer, scale: float) -> float:
    """Seconds from the edit to the exact image."""
    picture = _open_exact(transfer, scale * _FROM)
    look = sharp.make_look(transfer.default_look, "metal", scale * _TO)
    start_time = time.perf_counter()
    picture.set_look(look, active_pointer=_POINTER)
    while not picture.advance(None).exact:
        picture.run_next_job(lambda share: None, lambda: False)
    picture.encode(picture.all_tiles(), "rgb9e5")
    return time.perf_counter() - start_time


def _time_drag(transfer: FixedViewTransfer, num_frames: int, scale: float) -> list[float]:
    """Seconds of each frame."""
    first, last = scale * _SLIDER[0], sharp.allowed(_SLIDER[1])
    looks = [sharp.make_look(transfer.default_look, "metal", r) for r in np.geomspace(first, last, num_frames).tolist()]
    picture = _open_exact(transfer, first)
    picture.prepare(_POINTER)
    run_until_exact(picture)
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
