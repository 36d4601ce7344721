"""probes.brdf_vs_sun: speed of showing an edited material, relative to Sun 2007.

    ratio = (1 / frames per second of Sun 2007, table 1, "V&B") / (median from a look to its encoded frame)

The value is the smallest of three: Tweety, Indoor and Watch, with as many vertices as the Cornell box has probes here.
The exponent of the floor's highlight changes; its light on other surfaces follows some frames later, `lag_ms`, computed
in the background on the same cores. `p95_ms` is over frames that show it in all pixels, `per_s` counts all; `widest` is
the ratio for the walls. The camera is fixed, as in an editor; Sun's column lets view and BRDF change at once, on a
machine of 2007, in its own scenes and frame sizes. `moved_camera` is the ratio when our camera moves in each frame,
too.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from relume.core.thread_pools import num_threads
from relume_bench.figure import Figure
from relume_bench.free_camera_scene import Drag, FreeCameraScene
from relume_bench.probes import make_exponent_edit

_SUN_FRAME_RATES = {"tweety": (13_000, 28.73), "indoor": (35_700, 12.57), "watch": (62_100, 7.23)}
_FLOOR, _WALLS = "Floor", "Walls"


def measure(tiny: bool) -> list[Figure]:
    """Bake the box with as many probes as each of Sun's scenes has vertices, and edit it."""
    frames, size = (3, (60, 60)) if tiny else (60, (400, 400))
    context: dict[str, Any] = {"threads": num_threads(), "size": "×".join(map(str, size))}
    ratios = []
    for name, (num_probes, fps) in _SUN_FRAME_RATES.items():
        with tempfile.TemporaryDirectory() as folder:
            box = FreeCameraScene("cornell_box", Path(folder), size, tiny, num_probes=2000 if tiny else num_probes)
            sun_frame_ms = 1e3 / fps
            floor = box.edits(frames, make_exponent_edit(_FLOOR), is_watched=True)
            widest = box.edits(frames, make_exponent_edit(_WALLS), is_watched=True)
            moved = _drag_with_camera(box, frames)
        ratios.append(sun_frame_ms / (1e3 * floor.median_s))
        context |= {"floor": box.measure_visible_fraction(_FLOOR), "walls": box.measure_visible_fraction(_WALLS)}
        context[name] = {
            "probes": box.num_probes, "sun_ms": sun_frame_ms, "ratio": ratios[-1], **floor.summarize(),
            "widest": sun_frame_ms / (1e3 * widest.median_s), "moved_camera": sun_frame_ms / (1e3 * moved.median_s),
        }  # fmt: skip
    return [Figure("probes.brdf_vs_sun", min(ratios), "×", context)]


def _drag_with_camera(box: FreeCameraScene, frames: int) -> Drag:
    """Frames in which the camera moves and the floor is edited."""
    camera, change = box.scene.cameras[0], make_exponent_edit(_FLOOR)

    def move(picture: Any, k: int) -> None:
        to_world = camera.to_world.copy()
        to_world[:3, 3] += 0.01 * (k + 1) * to_world[:3, 0]
        picture.set_camera(replace(camera, to_world=to_world), box.size)

    return box.edits(max(2, frames // 3), change, is_watched=True, on_frame=move)
