"""free_camera.view_vs_sun, .brdf_vs_sun, .all_vs_sun, .light_age_ms_…, .all_rmse: what moves at once, and Sun 2007.

    ratio = (median seconds of Sun 2007, table 1, a frame) ÷ (our median from a change to its encoded frame)

The Cornell box at 400×400 has as many probes as each of Sun's scenes (Tweety, Indoor, Watch) had vertices. In every
frame the camera moves ("V"), or the camera moves and the exponent of the floor's highlight changes ("V&B"), or both
and the environment rotates ("V, B & L"). The figure is the smallest ratio. Sun's machine is a graphics card of 2007,
with other scenes and an unknown frame size; its frames are whole. Ours may show the reflected light, of all bounces of
the bake (24), of an earlier look: `light_age_ms` is the median age of that look when all three change; it cannot be
less than the time of a frame. `fixed_camera` is the ratio of an edit alone.

`free_camera.all_rmse`: the last frame when all three change, against the exact image of its look and camera (the static
view), relative RMS over pixels with surfaces, of the worst size.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from relume.core.thread_pools import num_threads
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.static_view import StaticViewBuilder
from relume.output.render_image import render_image
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import Change, Drag, FreeCameraScene
from relume_bench.probes import make_exponent_edit

_FLOOR = "Floor"
_FRAMES, _STEP = 24, 0.01  # of a drag; of the camera to the side, meters


class SunScene(NamedTuple):
    """A row of Sun's table 1: vertices, and frames per second."""

    vertices: int
    view: float
    brdf: float
    all: float


SUN_SCENES = {
    "13k": SunScene(13_000, 121.58, 28.73, 5.82),
    "36k": SunScene(35_700, 74.52, 12.57, 3.40),
    "62k": SunScene(62_100, 43.06, 7.23, 1.53),
}


class _Measured(NamedTuple):
    """Drags of one size: the camera; camera and material, and the material alone; all three, and their error."""

    num_probes: int
    view: Drag
    brdf: Drag
    fixed: Drag
    all: Drag
    error: float


def measure(tiny: bool) -> list[Figure]:
    """Bake each size, and drag."""
    measured = {name: _measure_size(sun, tiny) for name, sun in SUN_SCENES.items()}
    context: dict[str, Any] = {
        "threads": num_threads(), "size": "60×60" if tiny else "400×400",
        **{f"{name}_probes": each.num_probes for name, each in measured.items()},
    }  # fmt: skip

    def figure(kind: str, details: dict[str, Any]) -> Figure:
        drags = {name: getattr(each, kind) for name, each in measured.items()}
        ratios = {name: 1 / (getattr(SUN_SCENES[name], kind) * drag.median_s) for name, drag in drags.items()}
        times = {f"{name}_ms": 1e3 * drag.median_s for name, drag in drags.items()}
        return Figure(f"free_camera.{kind}_vs_sun", min(ratios.values()), "×", ratios | times | details | context)

    ages = {f"{name}_age_ms": 1e3 * each.brdf.lag_s for name, each in measured.items()}
    fixed = {
        f"{name}_fixed_camera": 1 / (SUN_SCENES[name].brdf * each.fixed.median_s) for name, each in measured.items()
    }
    errors = {name: 100 * each.error for name, each in measured.items()}
    return [
        figure("view", {}),
        figure("brdf", fixed | ages),
        figure("all", {}),
        *(
            Figure(f"free_camera.light_age_ms_{name}", 1e3 * each.all.lag_s, "ms", context)
            for name, each in measured.items()
        ),
        Figure("free_camera.all_rmse", max(errors.values()), "%", errors | context),
    ]


def _measure_size(sun: SunScene, tiny: bool) -> _Measured:
    """Bake the box with as many probes as a scene of Sun had vertices."""
    frames, size, num_probes = (2, (60, 60), 500) if tiny else (_FRAMES, (400, 400), sun.vertices)
    with tempfile.TemporaryDirectory() as folder:
        box = FreeCameraScene("cornell_box", Path(folder), size, tiny, num_probes)
        exponent = make_exponent_edit(_FLOOR)
        pictures, fractions = list[FreeCameraPicture](), list[float]()

        def all_three(document: dict[str, Any], fraction: float) -> None:
            document["environment"]["rotation"] = 60 * fraction
            exponent(document, fraction)
            fractions.append(fraction)

        def move(picture: FreeCameraPicture, k: int) -> None:
            to_world = box.scene.cameras[0].to_world.copy()
            to_world[:3, 3] += _STEP * (k + 1) * to_world[:3, 0]
            picture.set_camera(replace(box.scene.cameras[0], to_world=to_world), size)
            pictures.append(picture)

        def drag(change: Change, *, moves: bool = True) -> Drag:
            return box.edits(frames, change, is_watched=True, **({"on_frame": move} if moves else {}))

        view, brdf, fixed = drag(lambda document, fraction: None), drag(exponent), drag(exponent, moves=False)
        return _Measured(
            box.num_probes, view, brdf, fixed, drag(all_three), _error(box, pictures[-1], all_three, fractions[-2])
        )


def _error(box: FreeCameraScene, picture: FreeCameraPicture, change: Change, fraction: float) -> float:
    """Relative RMS of a frame against the exact image of the same look and camera, over surfaces.

    Args:
        box: its scene. picture: shows the frame. change, fraction: that made its look.
    """
    bake, view = box.free_camera_bake, box.recipe.views[0]
    exact = render_image(
        bake, view, box.look(lambda document: change(document, fraction)), camera_and_size=picture.sized_camera,
        static_views=StaticViewBuilder(bake.light_transport, box.scene),
    )  # fmt: skip
    width, height = picture.sized_camera[1]
    is_surface = (picture.gbuffer.hits.face[: width * height] >= 0).reshape(height, width)
    shown = picture.image()[is_surface]
    return float(np.linalg.norm(shown - exact[is_surface, :3]) / np.linalg.norm(exact[is_surface, :3]))
