"""probes.first_edit_s, probes.incremental_error: indirect light that follows edits of materials, all bounces.

`probes.first_edit_s`: from the first edit of a material in a bake that has been shown once, to the frame that shows its
effect on other surfaces; the longest of both scenes and of all drags.
`probes.incremental_error`: the image at the end of a drag, after the indirect light was updated, against the converged
one, relative to the change of the drag; the largest, and in the context all, also relative to the image.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from relume.core.thread_pools import num_threads
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import Change, FreeCameraScene, run_light_jobs, run_update_jobs

_STEPS = 8


def measure(tiny: bool) -> list[Figure]:
    """Drag one material after another."""
    with tempfile.TemporaryDirectory() as folder:
        return _measure_drags(Path(folder), tiny)


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
