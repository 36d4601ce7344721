"""demo.bake_s and demo.first_picture_s: what somebody waits who runs `relume demo`.

The bake is the demo's own, both views at 640×480 and 2,000 lights, from submitting to `ready`, the start of worker
processes included. The first picture: from the start of the server process to the first frame of a session on the
finished bake; once when the bake has never been opened, and once more.
"""

from __future__ import annotations

import time

from bench.figure import Figure
from bench.house import House, baked_house, serving, session
from relume.bake import Recipe
from relume.scene.demo import demo_scene
from worker.presets import PRESETS


def measure(tiny: bool) -> list[Figure]:
    """Bake, open twice."""
    preset, scene = PRESETS["preview" if tiny else "good"], demo_scene()
    size = (64, 48) if tiny else preset.size
    recipe = Recipe("direct", tuple(camera.name for camera in scene.cameras), size, preset.num_lights)
    with baked_house(scene, recipe) as house:
        first_s, again_s = _first_picture_s(house), _first_picture_s(house)
    context = {"size": list(size), "views": len(recipe.views), "lights": preset.num_lights}
    return [
        Figure("demo.bake_s", house.bake_s, "s", context),
        Figure("demo.first_picture_s", first_s, "s", {**context, "second_opening_s": again_s}),
    ]


def _first_picture_s(house: House) -> float:
    with serving(house) as server, session(server, house.bake) as client:
        client.frame()
        return time.perf_counter() - server.started_s
