"""opening.*: waiting times when opening a fixed-camera bake, or changing its light.

The still life, 1,000 lights, each bake opened for the first time, from the call that opens its store: `opening.first_s`
ends with the first encoded image, of direct light if indirect light was baked (`lit_s`: the first preview of all
light), `opening.exact_s` and `opening.exact_gather_s` with the exact one, of 640×480 pixels, of direct and of all
light. `opening.prewarmed_s`, `opening.prewarmed_gather_s`: the same exact images of bakes whose first images were
rendered in advance. `opening.relight_s`, `opening.relight_gather_s`: from a look with a rotated, or another,
environment to its exact image, the longer of the two.

`opening.large_…`: the same for direct light at 1920×1080 pixels; `opening.large_edit_ms`: look → encoded bytes while
the teapot's highlight is dragged, the median. Their contexts also have 3840×2160 pixels; `opening.larger_ratio`: the
largest ratio of both sizes' figures ÷ that of their pixels.
"""

from __future__ import annotations

import copy
import shutil
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
from relume.look import Look, validate
from relume.methods.direct import DirectMethod
from relume.methods.gather import GatherMethod
from relume.output.render_image import render_image
from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import BakeMethod, Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure
from relume_bench.timing import seconds
from relume_bench.until_exact import run_until_exact

_CACHE_BYTES = 6 << 30  # default cache budget of a server
_ACTIVE_POINTER = "/materials/Teapot/terms/1/params/nu"
_EDITS = 30
_TURNED, _EXCHANGED = {"rotation": 50.0}, {"map": "clear_sky"}


class _Waits(NamedTuple):
    """Seconds until the first image, the first with all light, the exact one, the exact one from prewarmed data, and
    exact ones with two other environments; milliseconds per frame.
    """

    first_s: float
    lit_s: float
    exact_s: float
    ahead_s: float
    turned_s: float
    exchanged_s: float
    edit_ms: float

    @property
    def relit_s(self) -> float:
        """The longer one of both environments."""
        return max(self.turned_s, self.exchanged_s)


def measure(tiny: bool) -> list[Figure]:
    """Bake, open and change the light in all sizes, after tiny ones that compile."""
    small, large, larger = ((48, 36), (64, 36), (96, 54)) if tiny else ((640, 480), (1920, 1080), (3840, 2160))
    num_lights = 60 if tiny else 1000
    direct, gather = DirectMethod(), GatherMethod()
    for method in (direct, gather):
        _measure_waits(method, (48, 36), 60)
    direct_waits, gather_waits = (_measure_waits(method, small, num_lights) for method in (direct, gather))
    hd, uhd = (_measure_waits(direct, size, num_lights) for size in (large, larger))
    common = {"lights": num_lights, "threads": num_threads()}
    small_context = {"size": list(small), **common, "direct": direct_waits._asdict(), "gather": gather_waits._asdict()}
    large_context = {**common, _name(large): hd._asdict(), _name(larger): uhd._asdict()}
    pixels = larger[0] * larger[1] / (large[0] * large[1])
    return [
        Figure("opening.first_s", max(direct_waits.first_s, gather_waits.first_s), "s", small_context),
        Figure("opening.exact_s", direct_waits.exact_s, "s", small_context),
        Figure("opening.exact_gather_s", gather_waits.exact_s, "s", small_context),
        Figure("opening.prewarmed_s", direct_waits.ahead_s, "s", small_context),
        Figure("opening.prewarmed_gather_s", gather_waits.ahead_s, "s", small_context),
        Figure("opening.relight_s", direct_waits.relit_s, "s", small_context),
        Figure("opening.relight_gather_s", gather_waits.relit_s, "s", small_context),
        Figure("opening.large_first_s", hd.first_s, "s", large_context),
        Figure("opening.large_exact_s", hd.exact_s, "s", large_context),
        Figure("opening.large_edit_ms", hd.edit_ms, "ms", large_context),
        Figure("opening.larger_ratio", float(np.max(np.divide(uhd, hd)) / pixels), "ratio", large_context),
    ]


def _name(size: tuple[int, int]) -> str:
    return f"{size[0]}×{size[1]}"


def _measure_waits(method: BakeMethod, size: tuple[int, int], num_lights: int) -> _Waits:
    scene = demo_scene()
    view = scene.cameras[0].name
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe(method.name, (view,), size, num_lights)
        path = bake_in_process(method, scene, recipe, Path(folder) / "opened.zarr")
        start_time = time.perf_counter()
        transfer, picture = _open_picture(path, view)
        while not picture.advance(None).complete:
            _run_next_job(picture)
        picture.encode(picture.all_tiles(), "rgb9e5")
        first_s = time.perf_counter() - start_time
        while (job := picture.next_job()) is not None and job.kind == "preview":
            _run_next_job(picture)
            picture.advance(None)
        picture.encode(picture.all_tiles(), "rgb9e5")
        lit_s = time.perf_counter() - start_time
        _encode_exact(picture)
        exact_s = time.perf_counter() - start_time
        shutil.rmtree(path / "derived")
        _prewarm(path, view)
        prewarmed_s = seconds(lambda: _encode_exact(_open_picture(path, view)[1]))
        rotated_s, exchanged_s = (_relit_s(transfer, picture, light) for light in (_TURNED, _EXCHANGED))
        _relit_s(transfer, picture, {})
        return _Waits(first_s, lit_s, exact_s, prewarmed_s, rotated_s, exchanged_s, _edit_ms(transfer, picture))


def _open_picture(path: Path, view: str) -> tuple[FixedViewTransfer, Picture]:
    """Open a bake with an empty cache, and its image."""
    transfer = open_transfer(path, Cache(_CACHE_BYTES))
    return transfer, Picture(transfer, view, Cache(_CACHE_BYTES), is_watched=True)


def _prewarm(path: Path, view: str) -> None:
    """Prewarm a bake."""
    transfer = open_transfer(path, Cache(_CACHE_BYTES))
    render_image(transfer, view, validate(transfer.default_look, transfer.default_look))


def _run_next_job(picture: Picture) -> None:
    picture.run_next_job(lambda share: None, lambda: False)


def _encode_exact(picture: Picture) -> None:
    """Run all pending jobs, and encode the exact image."""
    run_until_exact(picture)
    picture.encode(picture.all_tiles(), "rgb9e5")


def _relit_s(transfer: FixedViewTransfer, picture: Picture, light: dict[str, Any]) -> float:
    """Seconds until the exact image of the default look in another environment."""
    document = copy.deepcopy(transfer.default_look)
    document["environment"] |= light
    picture.set_look(validate(document, transfer.default_look))
    return seconds(lambda: _encode_exact(picture))


def _edit_ms(transfer: FixedViewTransfer, picture: Picture) -> float:
    """Median frame time of a drag with a precomputed operator."""
    picture.prepare(_ACTIVE_POINTER)
    _encode_exact(picture)
    durations = []
    for exponent in np.geomspace(20, 200, _EDITS):
        look = _sharpened(transfer, float(exponent))
        start_time = time.perf_counter()
        picture.set_look(look, active_pointer=_ACTIVE_POINTER)
        picture.encode(picture.advance(None).tiles, "rgb9e5")
        durations.append(time.perf_counter() - start_time)
    return 1e3 * float(np.median(durations))


def _sharpened(transfer: FixedViewTransfer, exponent: float) -> Look:
    document = copy.deepcopy(transfer.default_look)
    document["materials"]["Teapot"]["terms"][1]["params"]["nu"] = exponent
    return validate(document, transfer.default_look)
