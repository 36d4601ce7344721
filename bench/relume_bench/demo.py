"""demo.preview_s, demo.bake_s and demo.first_picture_s: what somebody waits who runs `relume demo`.

The bakes are the demo's own with indirect light, of both views: the preview at 320×240 and 300 lights, with which
people begin, and the one at 640×480 and 2,000 lights that takes its place. Each from submitting to `ready`, alone, the
start of worker processes included where it needs some. The first picture: from the start of the server process to the
first frame of a session on the finished bake; once when the bake has never been opened, and once more.
"""

from __future__ import annotations

import time
from dataclasses import replace

from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure
from relume_bench.house import House, baked_house, serving, session
from relume_cli.demo import demo_recipes


def measure(tiny: bool) -> list[Figure]:
    """Bake both, open the second twice."""
    scene = demo_scene()
    preview, recipe = (replace(each, size=(64, 48), num_lights=60) if tiny else each for each in demo_recipes(scene))
    with baked_house(scene, preview) as house:
        preview_s = house.bake_s
    with baked_house(scene, recipe) as house:
        first_s, second_s = _first_picture_s(house), _first_picture_s(house)
    context, preview_context = _context(recipe), _context(preview)
    return [
        Figure("demo.preview_s", preview_s, "s", preview_context),
        Figure("demo.bake_s", house.bake_s, "s", context),
        Figure("demo.first_picture_s", first_s, "s", {**context, "second_opening_s": second_s}),
    ]


def _context(recipe: Recipe) -> dict[str, object]:
    return {
        "method": recipe.method,
        "size": list(recipe.size),
        "views": len(recipe.views),
        "lights": recipe.num_lights,
    }


def _first_picture_s(house: House) -> float:
    with serving(house) as server, session(server, house.bake) as client:
        client.frame()
        return time.perf_counter() - server.started_s
