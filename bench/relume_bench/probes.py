"""probes.*: waiting times when moving the camera, a material or a light of a free-camera view.

Scenes: the Cornell box under the environment at 400×400, and the still life at 640×480, which has twice as many
triangles as probes. Times are from a message's content to the encoded bytes. `probes.view_fps`: the camera moves
sideways, the look is constant, and highlights are refined only when the camera stops; `probes.sun_fps`: the same under
a clear sky, whose sun casts per-pixel shadows. `probes.brdf_ms`: the exponent of the floor's highlight changes, camera
and lights are constant; `edited_fraction` of the image's pixels show it. Indirect light is computed in the background
and lags by `lag_ms`; `per_s` counts all frames, also those between updates of indirect light. `probes.light_ms`: the
environment rotates, with all bounces, and is updated incrementally in the same way; `all_probes_ms` is the time of the
full update, after the drag. `probes.against_fixed_…` is the free-camera view against the image that replaces it, of a
`gather` bake from the same camera, without pixels at object edges, which only one side antialiases; both treat light
that highlights reflect onto other surfaces as diffuse.
"""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from relume.core.thread_pools import num_threads
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import FreeCameraScene, rotated


def measure(tiny: bool) -> list[Figure]:
    """Bake both scenes, move, edit, compare."""
    with tempfile.TemporaryDirectory() as folder:
        box = FreeCameraScene("cornell_box", Path(folder), (60, 60) if tiny else (400, 400), tiny)
        still_life = FreeCameraScene(
            "interior" if tiny else "still_life", Path(folder), (64, 48) if tiny else (640, 480), tiny
        )
        frames = 3 if tiny else 60
        camera_times = {scene.name: scene.time_camera_moves(frames) for scene in (box, still_life)}
        sun_times = {scene.name: scene.time_camera_moves(frames, _clear) for scene in (box, still_life)}
        context = {"threads": num_threads(), "probes": {scene.name: scene.num_probes for scene in (box, still_life)}}
        brdf, light = (
            box.edits(frames, make_exponent_edit(_EDITED), is_watched=True),
            box.edits(max(2, frames // 6), rotated, is_watched=True),
        )
        exactly = {"all_probes_ms": 1e3 * box.edits(3, rotated).median_s}
        return [
            Figure("probes.bake_s", still_life.bake_s, "s", {**context, "cornell_box": box.bake_s, **still_life.sizes}),
            Figure("probes.bytes_per_probe", still_life.num_bytes / still_life.num_probes, "bytes", context),
            Figure(
                "probes.view_fps",
                1 / float(np.median(camera_times[still_life.name])),
                "frames/s",
                {**context, "size": "640×480", "cornell_box_400": 1 / float(np.median(camera_times["cornell_box"]))},
            ),
            Figure(
                "probes.sun_fps",
                1 / float(np.median(sun_times[still_life.name])),
                "frames/s",
                {**context, "size": "640×480", "cornell_box_400": 1 / float(np.median(sun_times["cornell_box"]))},
            ),
            Figure(
                "probes.brdf_ms",
                1e3 * brdf.median_s,
                "ms",
                {
                    **context,
                    **brdf.summarize(),
                    "edited_fraction": box.measure_visible_fraction(_EDITED),
                    "size": "400×400",
                    "bounces": "all",
                },
            ),
            Figure(
                "probes.light_ms",
                1e3 * light.median_s,
                "ms",
                {**context, **light.summarize(), **exactly, "size": "400×400", "bounces": "all"},
            ),
            *(_error(box if "diffuse" in name else still_life, name, terms) for name, terms in _MATERIALS.items()),
        ]


_MATERIALS: dict[str, list[dict[str, Any]]] = {
    "probes.against_fixed_diffuse": [{"model": "lambert", "color": [0.7, 0.7, 0.7], "texture": None}],
    "probes.against_fixed_glossy_0.5": [{"model": "ggx", "params": {"roughness": 0.5, "f0": 0.9}, "texture": None}],
    "probes.against_fixed_glossy_0.3": [{"model": "ggx", "params": {"roughness": 0.3, "f0": 0.9}, "texture": None}],
}
_EDITED = "Floor"
_GLOSSY = {"model": "blinn_phong", "color": [0.5, 0.5, 0.5], "texture": None, "params": {"exponent": 20.0}}


def _clear(document: dict[str, Any]) -> None:
    document["environment"]["map"] = "clear_sky"


def make_exponent_edit(material: str) -> Callable[[dict[str, Any], float], None]:
    """Edit of a look: the exponent of a material's highlight, from 5 to 35 by a fraction."""

    def change(document: dict[str, Any], fraction: float) -> None:
        white = {"model": "lambert", "color": [0.3, 0.3, 0.3], "texture": None}
        highlight = {**_GLOSSY, "params": {"exponent": 5.0 + 30 * fraction}}
        document["materials"][material]["terms"] = [white, highlight]

    return change


def _error(scene: FreeCameraScene, name: str, terms: list[dict[str, Any]]) -> Figure:
    """Error in a scene whose surfaces all have one material."""

    def change(document: dict[str, Any]) -> None:
        for material in document["materials"].values():
            material["terms"] = copy.deepcopy(terms)

    image, exact, inner = scene.picture(scene.look(change)).image(), scene.exact(change), scene.inner()
    error = float(np.sqrt(np.mean((image[inner] - exact[inner]) ** 2) / np.mean(exact[inner] ** 2)))
    bias = float(image[inner].mean() / exact[inner].mean() - 1)
    everywhere = float(np.sqrt(np.mean((image - exact) ** 2) / np.mean(exact**2)))
    context = {"scene": scene.name, "bias": bias, "with_edges": everywhere, "pixels": int(inner.sum()), **scene.sizes}
    return Figure(name, 100 * error, "%", context)
