"""solve.error…: lights found from a picture of known lights; solve.ms: time of one solution for 20 lights.

The Cornell box with direct light, 640×480, 20 point lights of random intensities and colors; the match starts with
equal white ones. The error is that of the picture with the lights that were found, without noise and with 2 % noise in
the target, relative RMS over all pixels of the small images that a session solves with.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.inverse_lighting.match_lights import match_lights
from relume.inverse_lighting.match_look import REFERENCE_RIDGE
from relume.inverse_lighting.painting import Stroke, brush_mask, painted_target
from relume.inverse_lighting.solve import Target
from relume.inverse_lighting.sources import Sources, load_sources
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_small
from relume.scene.examples.cornell import cornell_box
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure

F32 = NDArray[np.float32]
_NOISE = 0.02
_WIDTH = 160
_NUM_TIMED = 20


def measure(tiny: bool) -> list[Figure]:
    """Errors of the picture without and with noise, and the median time of a stroke's solution."""
    rng, num_lights, size = np.random.default_rng(0), 4 if tiny else 20, (64, 48) if tiny else (640, 480)
    with tempfile.TemporaryDirectory() as folder:
        sources = _load_sources(Path(folder), num_lights, size, rng)
    strengths = rng.uniform(0.0, 3.0, (len(sources.pointers), 3))
    picture = sources.image(strengths)
    context = {"lights": num_lights, "size": list(size), "solved_size": list(picture.shape[1::-1])}
    noise = 1.0 + _NOISE * rng.standard_normal(picture.shape)
    return [
        Figure("solve.error", _error(sources, picture, picture), "relative RMS", context),
        Figure(
            "solve.error_noisy",
            _error(sources, (picture * noise).astype(np.float32), picture),
            "relative RMS",
            {**context, "noise": _NOISE},
        ),
        Figure("solve.ms", _stroke_ms(sources), "ms", context),
    ]


def _load_sources(folder: Path, num_lights: int, size: tuple[int, int], rng: np.random.Generator) -> Sources:
    recipe = Recipe("direct", ("front",), size, 20)
    transfer = open_transfer(
        bake_in_process(METHODS["direct"], cornell_box(), recipe, folder / "direct.zarr"), Cache(4 << 30)
    )
    lights: dict[str, Any] = {
        f"Light {k}": {"kind": "point", "position": rng.uniform([-0.8, 0.2, -0.8], [0.8, 1.8, 0.8]).tolist()}
        for k in range(num_lights)
    }
    look = validate({"lights": lights}, transfer.default_look)
    return load_sources(look, lambda single: render_small(transfer, "front", single, _WIDTH))


def _error(sources: Sources, target: F32, picture: F32) -> float:
    whole = painted_target([], picture, Target(target, np.ones(target.shape[:2], np.float32)))
    match = match_lights(sources, whole, ridge=REFERENCE_RIDGE)
    strengths = sources.strengths
    for pointer, fields in match.changes.items():
        strengths[sources.pointers.index(pointer)] = np.multiply(fields["intensity"], fields.get("color", 1.0))
    return float(np.linalg.norm(sources.image(strengths) - picture) / np.linalg.norm(picture))


def _stroke_ms(sources: Sources) -> float:
    image = sources.image(sources.strengths)
    height, width = image.shape[:2]
    times = []
    for k in range(_NUM_TIMED):
        start = time.perf_counter()
        mask = brush_mask([(0.3 * width, 0.5 * height), ((0.3 + 0.02 * k) * width, 0.5 * height)], 8, (width, height))
        match_lights(sources, painted_target([Stroke("brighter", mask)], image))
        times.append(1e3 * (time.perf_counter() - start))
    return float(np.median(times))
