"""solve.error…: lights and materials found from a picture; solve.ms: time of one solution for 20 lights.

The Cornell box with direct and indirect light, and 20 point lights. The picture has random intensities and colors of
the lights, another color of a wall, and another color and width of the floor's highlight. The match starts with equal
white lights and the materials of the scene, and may change the lights and these two materials. The error is that of the
picture after the match, without noise and with 2 % noise in the target, relative RMS over all pixels of the small
images that a session solves with; the target has the size of the bake. The context has the error if materials stay.
"""

from __future__ import annotations

import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.image_io.write_image import write_image
from relume.inverse_lighting.match_lights import match_lights
from relume.inverse_lighting.match_look import MatchRequest, match_look
from relume.inverse_lighting.painting import Stroke, brush_mask, painted_target
from relume.inverse_lighting.sources import RenderLook, Sources, load_sources, merge_changes
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import Look, complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image, render_small
from relume.scene.examples.cornell import GLOSSY_FLOOR, cornell_box
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure

F32 = NDArray[np.float32]
_NOISE = 0.02
_WIDTH = 160
_VIEW = "front"
_MATERIALS = frozenset({"Red wall", "Floor"})
_NUM_TIMED = 20


def measure(tiny: bool) -> list[Figure]:
    """Errors of the picture without and with noise, and the median time of a stroke's solution."""
    rng, num_lights, size = np.random.default_rng(0), 4 if tiny else 20, (64, 48) if tiny else (640, 480)
    with tempfile.TemporaryDirectory() as folder:
        transfer = _bake(Path(folder), size)

        def render(look: Look) -> F32:
            return render_small(transfer, _VIEW, look, _WIDTH)

        render_whole = partial(render_image, transfer, _VIEW)

        start, target = _looks(transfer.default_look, num_lights, rng)
        picture, small = render_image(transfer, _VIEW, target)[..., :3], render(target)[..., :3]
        context = {"lights": num_lights, "size": list(size), "solved_size": list(small.shape[1::-1])}
        figures = []
        for name, noise in (("solve.error", 0.0), ("solve.error_noisy", _NOISE)):
            noisy = picture * (1.0 + noise * rng.standard_normal(picture.shape))
            lights_alone, with_materials = (
                _error(start, render, render_whole, noisy.astype(np.float32), small, Path(folder), materials)
                for materials in (frozenset[str](), _MATERIALS)
            )
            errors = {"noise": noise, "materials": sorted(_MATERIALS), "lights_alone": lights_alone}
            figures.append(Figure(name, with_materials, "relative RMS", context | errors))
        sources = load_sources(start, render)
    return [*figures, Figure("solve.ms", _stroke_ms(sources), "ms", context)]


def _bake(folder: Path, size: tuple[int, int]) -> FixedViewTransfer:
    recipe = Recipe("gather", (_VIEW,), size, 20)
    return open_transfer(
        bake_in_process(METHODS["gather"], cornell_box(is_floor_glossy=True), recipe, folder / "gather.zarr"),
        Cache(4 << 30),
    )


def _looks(default_look: dict[str, Any], num_lights: int, rng: np.random.Generator) -> tuple[Look, Look]:
    """The look that the match starts with, and that of the picture."""
    positions = rng.uniform([-0.8, 0.2, -0.8], [0.8, 1.8, 0.8], (num_lights, 3))
    emissions = rng.uniform(0.0, 3.0, (num_lights, 3))
    lights = [{"kind": "point", "position": position.tolist()} for position in positions]
    wall, floor = {"terms": [{"model": "lambert", "color": [0.1, 0.2, 0.6]}]}, [dict(term) for term in GLOSSY_FLOOR]
    floor[1] |= {"color": [0.2, 0.1, 0.05], "params": {"exponent": 30.0}}
    start = {"lights": {f"Light {k}": light for k, light in enumerate(lights)}}
    target = {
        "lights": {f"Light {k}": {**light, "emission": emissions[k].tolist()} for k, light in enumerate(lights)},
        "materials": {"Red wall": wall, "Floor": {"terms": floor}},
    }
    return validate(complete(start, default_look), default_look), validate(complete(target, default_look), default_look)


def _error(
    look: Look,
    render: RenderLook,
    render_whole: RenderLook,
    target: F32,
    picture: F32,
    folder: Path,
    materials: frozenset[str],
) -> float:
    """Match a look to a target of full size, and compare its small image with that of the picture."""
    write_image(folder / "target.exr", target)
    request = MatchRequest(reference=(folder / "target.exr").read_bytes(), materials=materials)
    match = match_look(look, render, render_whole, (picture.shape[1], picture.shape[0]), request)
    after = Look.model_validate(merge_changes(look.model_dump(mode="json"), match.operations))
    return float(np.linalg.norm(render(after)[..., :3] - picture) / np.linalg.norm(picture))


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
