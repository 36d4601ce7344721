"""probes.all_vs_sun, probes.first_edit_s, probes.incremental_error: camera, light and materials at once, all bounces.

`probes.all_vs_sun`: in every frame the camera moves, the environment rotates to a new angle, and the exponent of the
floor's highlight, which lights all other surfaces, changes, with as many bounces as the bake has (24), and with two; of
the Cornell box at 400×400, with as many probes as scenes of Sun 2007 had vertices, whose frames per second (table 1,
light, view and BRDF) are the other side; the smallest ratio. Indirect light is computed in the background, on the same
cores, and is `lag` old. `probes.first_edit_s`: from the first edit of a material in a bake that has been shown once, to
the frame that shows its effect on other surfaces; the longest of both scenes and of all drags.
`probes.incremental_error`: the image at the end of a drag, after the indirect light was updated, against the converged
one, relative to the change of the drag; the largest, and in the context all, also relative to the image.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.core.thread_pools import num_threads
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import Drag, FreeCameraScene, run_light_jobs, run_update_jobs

_SUN_FRAME_RATES = {13_000: 5.82, 35_700: 3.40, 62_100: 1.53}
_FRAMES, _STEPS = 24, 8
Change = Callable[[dict[str, Any], float], None]


def measure(tiny: bool) -> list[Figure]:
    """Change all three at each size; then drag one material after another."""
    with tempfile.TemporaryDirectory() as folder:
        context: dict[str, Any] = {"threads": num_threads(), "size": "60×60" if tiny else "400×400"}
        return [_all(Path(folder), context, tiny), *_measure_drags(Path(folder), tiny)]


def _all(folder: Path, context: dict[str, Any], tiny: bool) -> Figure:
    ratios, size_details = [], dict[str, Any]()
    for num_probes, sun_fps in list(_SUN_FRAME_RATES.items())[: 1 if tiny else None]:
        (scratch := folder / str(num_probes)).mkdir()
        box = FreeCameraScene(
            "cornell_box", scratch, (60, 60) if tiny else (400, 400), tiny, None if tiny else num_probes
        )
        whole, two = (_together(box, 2 if tiny else _FRAMES, bounces) for bounces in (24, 2))
        ratios.append(1 / (sun_fps * whole.median_s))
        size_details[f"{box.num_probes}_points"] = (
            f"{1e3 * whole.median_s:.0f} ms, {1 / whole.median_s:.1f} frames/s, lag {1e3 * whole.lag_s:.0f} ms, "
            f"two bounces {1e3 * two.median_s:.0f} ms; Sun {sun_fps} frames/s"
        )
    return Figure("probes.all_vs_sun", min(ratios), "ratio", {**size_details, **context})


def _together(scene: FreeCameraScene, frames: int, bounces: int) -> Drag:
    """Frames in which all three change."""
    camera = scene.scene.cameras[0]

    def change(document: dict[str, Any], fraction: float) -> None:
        document["environment"]["rotation"] = 60 * fraction
        document["transport"]["bounces"] = bounces
        _exponent(document, fraction)

    def move(picture: FreeCameraPicture, k: int) -> None:
        to_world = camera.to_world.copy()
        to_world[:3, 3] += 0.01 * (k + 1) * to_world[:3, 0]
        picture.set_camera(replace(camera, to_world=to_world), scene.size)

    return scene.edits(frames, change, is_watched=True, on_frame=move)


def _lambert(red: float, green: float, blue: float) -> dict[str, Any]:
    return {"model": "lambert", "color": [red, green, blue], "texture": None}


def _metal(roughness: float, color: list[float]) -> dict[str, Any]:
    return {"model": "ggx", "color": color, "params": {"roughness": roughness, "f0": 0.9}, "texture": None}


def _first(document: dict[str, Any]) -> dict[str, Any]:
    material: dict[str, Any] = next(iter(document["materials"].values()))
    return material


def _exponent(document: dict[str, Any], fraction: float) -> None:
    highlight = {"model": "blinn_phong", "color": [0.5, 0.5, 0.5], "params": {"exponent": 5.0 + 30 * fraction}}
    _first(document)["terms"] = [_lambert(0.3, 0.3, 0.3), {**highlight, "texture": None}]


def _diffuse(document: dict[str, Any], fraction: float) -> None:
    _first(document)["terms"] = [_lambert(0.7 - 0.5 * fraction, 0.2 + 0.4 * fraction, 0.2)]


def _metal_color(document: dict[str, Any], fraction: float) -> None:
    _first(document)["terms"] = [_metal(0.35, [1 - 0.6 * fraction, 0.9 - 0.2 * fraction, 0.8])]


def _roughness(document: dict[str, Any], fraction: float) -> None:
    _first(document)["terms"] = [_lambert(0.3, 0.3, 0.3), _metal(0.6 - 0.3 * fraction, [0.4, 0.4, 0.4])]


def _draw_curve(document: dict[str, Any], fraction: float) -> None:
    curve = {"points": [[0, 4 + 6 * fraction], [15, 3], [35, 0.2 + 1.5 * fraction], [90, 0]]}
    highlight = {"model": "blinn_phong", "color": [0.3, 0.3, 0.3], "params": {"exponent": 10.0}, "texture": None}
    _first(document)["terms"] = [_lambert(0.2, 0.2, 0.2), {**highlight, "curves": {"theta_h": curve}}]


_DRAGS: dict[str, Change] = {
    "diffuse_colour": _diffuse, "metal_colour": _metal_color, "roughness": _roughness, "drawn_curve": _draw_curve,
}  # fmt: skip


def _measure_drags(folder: Path, tiny: bool) -> list[Figure]:
    box = FreeCameraScene("cornell_box", folder, (60, 60) if tiny else (400, 400), tiny)
    still_life = FreeCameraScene("interior" if tiny else "still_life", folder, (64, 48) if tiny else (640, 480), tiny)
    context: dict[str, Any] = {"threads": num_threads(), "sizes": "400×400, 640×480"}
    first, errors = dict[str, float](), dict[str, tuple[float, float]]()
    for scene in (box, still_life):
        for name, change in _DRAGS.items():
            first[f"{scene.name}_{name}"], errors[f"{scene.name}_{name}"] = _measure_drag(scene, change)
    error_texts = {
        name: f"{100 * change_error:.1f} % of the change, {100 * image_error:.2f} % of the image"
        for name, (change_error, image_error) in errors.items()
    }
    return [
        Figure("probes.first_edit_s", max(first.values()), "s", {**first, **context}),
        Figure(
            "probes.incremental_error",
            100 * max(error for error, _ in errors.values()),
            "%",
            {**error_texts, **context},
        ),
    ]


def _measure_drag(scene: FreeCameraScene, change: Change) -> tuple[float, tuple[float, float]]:
    """Seconds of the first edit, and the error of the last frame relative to the change and to the image."""
    looks = [
        scene.look(lambda document, k=k: change(document, k / _STEPS))  # type: ignore[misc]
        for k in range(_STEPS + 1)
    ]
    picture, first = scene.picture(looks[0], is_watched=True), 0.0
    before = picture.image().copy()
    for look in looks[1:]:
        start_time = time.perf_counter()
        picture.set_look(look)
        picture.advance(None)
        run_update_jobs(picture)
        picture.encode(picture.all_tiles(), "rgb9e5")
        first = first or time.perf_counter() - start_time
    incremental = picture.image().copy()
    run_light_jobs(picture)
    exact = picture.image()
    off, changed, whole = (float(np.linalg.norm(a)) for a in (incremental - exact, exact - before, exact))
    return first, (off / changed, off / whole)
