"""gather.light_move_fps, gather.area_light_move_fps, gather.light_intensity_fps: dragging lights in the gather room.

A point light and a rectangle of 0.5 × 0.5 m below the ceiling are moved, and the rectangle is dimmed; from the look to
the encoded bytes, medians, with the drag announced and prepared. The frame of a moved light may be approximate: after
the drag it is shaded exactly, and `incremental_error` is the error of the last frame.

`over_embreex` is the time of a frame ÷ that of `EmbreeScene.run`, in one thread, for a shadow ray from each view sample
to the center of the light: the minimum for a frame with new shadows.
"""

from __future__ import annotations

import copy
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Scene
from relume_bench.figure import Figure
from relume_bench.gather import bake, make_recipe
from relume_bench.rays import embreex_scene
from relume_bench.timing import seconds, time_interleaved
from relume_bench.until_exact import run_until_exact

_NAMES = ("gather.light_move_fps", "gather.area_light_move_fps", "gather.light_intensity_fps")
_SPEED = "frames/s"
_POINT_LIGHT: dict[str, Any] = {"kind": "point", "emission": [1.0, 1.0, 1.0]}
_PANEL: dict[str, Any] = {"kind": "rectangle", "direction": [0.0, -1.0, 0.0], "emission": [4.0, 4.0, 4.0]}


def measure(tiny: bool) -> list[Figure]:
    """Measure three drags: a point light moved, an area light moved, an area light dimmed."""
    num_frames, recipe = 3 if tiny else 24, make_recipe(tiny)
    with tempfile.TemporaryDirectory() as folder:
        scene = cornell_box(is_floor_glossy=True)
        transfer = open_transfer(bake(scene, recipe, Path(folder) / "gather.zarr").path, Cache(4 << 30))
        light_positions = [{"position": [float(x), 1.7, 0.2]} for x in np.linspace(-0.4, 0.4, num_frames)]
        scales = [{**light_positions[-1], "intensity": float(scale)} for scale in np.geomspace(0.1, 3, num_frames)]
        drags = [
            [_POINT_LIGHT | light_position for light_position in light_positions],
            [_PANEL | light_position for light_position in light_positions],
            [_PANEL | scale for scale in scales],
        ]
        drag_results = [_measure_drag(transfer, Picture(transfer, "front", Cache(4 << 30)), drag) for drag in drags]
        embreex_s = _embreex_s(scene, recipe.size, light_positions[-1]["position"])
    return [
        Figure(name, 1 / float(np.median(drag.frames_s)), _SPEED, {
            "ms_p50": 1e3 * float(np.median(drag.frames_s)), "ms_max": 1e3 * max(drag.frames_s),
            "over_embreex": float(np.median(drag.frames_s)) / embreex_s, "incremental_error": drag.error,
            "prepared_once_s": drag.prepared_s, "size": list(recipe.size),
        })
        for name, drag in zip(_NAMES, drag_results, strict=True)
    ]  # fmt: skip


class _LightDrag(NamedTuple):
    """frames_s: seconds of each frame. prepared_s: one-time work: transport rows for a move, the light's image for
    dimming. error: error of the last frame, relative RMSE against the exact image.
    """

    frames_s: list[float]
    prepared_s: float
    error: float


def _measure_drag(transfer: FixedViewTransfer, picture: Picture, point_lights: Sequence[dict[str, Any]]) -> _LightDrag:
    """The first two frames are excluded: one is converged, the other requests the light's image, and compiles."""
    frames_s, prepared_s = [], 0.0
    for k, point_light in enumerate(point_lights):
        document = copy.deepcopy(transfer.default_look)
        document["lights"]["Lamp"] = point_light
        look = validate(document, transfer.default_look)
        start_time = time.perf_counter()
        picture.set_look(look)
        picture.encode(picture.advance(None).tiles, "rgb9e5")
        frames_s.append(time.perf_counter() - start_time)
        if k == 0:
            run_until_exact(picture)
            picture.prepare("/lights/Lamp")
        if k <= 1:
            prepared_s += seconds(partial(run_until_exact, picture))
    incremental = picture.image().astype(np.float64)
    run_until_exact(picture)
    exact = picture.image().astype(np.float64)
    error = float(np.sqrt(np.mean((incremental - exact) ** 2) / np.mean(exact**2)))
    return _LightDrag(frames_s[2:], prepared_s, error)


def _embreex_s(scene: Scene, size: tuple[int, int], position: Sequence[float]) -> float:
    """Seconds of a shadow ray from each view sample, in stored order; the best of five."""
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, "front", size)
    origins = np.ascontiguousarray(samples.surface.points.position[samples.material != BACKGROUND])
    directions = (np.array(position, np.float32) - origins).astype(np.float32)
    peer = embreex_scene(geometry)
    return min(time_interleaved([lambda: peer.run(origins, directions, query="OCCLUDED")], 5)[0])
