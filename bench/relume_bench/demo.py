"""demo.preview_s, demo.bake_s and demo.first_picture_s: waiting times of `relume demo`.

The demo's own bakes with indirect light, of both views: the preview at 320×240 and 300 lights, and the bake at 640×480
and 2,000 lights that replaces it. Each from submitting to `ready`, alone, including the start of worker processes if
needed. First image: from the start of the server process to the first frame of a session on the finished bake; once for
a bake that was never opened, and once more.
"""

from __future__ import annotations

import time
from dataclasses import replace

from relume.scene.examples.still_life import demo_scene
from relume.store.bake_protocol import Recipe
from relume_bench.baked_server import BakedFolder, baked_folder, serving, session
from relume_bench.figure import Figure
from relume_cli.demo import demo_recipes


def measure(tiny: bool) -> list[Figure]:
    """Bake both, open the second twice."""
    scene = demo_scene()
    preview, recipe = (replace(each, size=(64, 48), num_lights=60) if tiny else each for each in demo_recipes(scene))
    with baked_folder(scene, preview) as data_folder:
        preview_s = data_folder.bake_s
    with baked_folder(scene, recipe) as data_folder:
        first_s, second_s = _first_picture_s(data_folder), _first_picture_s(data_folder)
    context, preview_context = _context(recipe), _context(preview)
    return [
        Figure("demo.preview_s", preview_s, "s", preview_context),
        Figure("demo.bake_s", data_folder.bake_s, "s", context),
        Figure("demo.first_picture_s", first_s, "s", {**context, "second_opening_s": second_s}),
    ]


def _context(recipe: Recipe) -> dict[str, object]:
    return {
        "method": recipe.method,
        "size": list(recipe.size),
        "views": len(recipe.views),
        "lights": recipe.num_lights,
    }


def _first_picture_s(data_folder: BakedFolder) -> float:
    with serving(data_folder) as server, session(server, data_folder.bake) as client:
        client.frame()
        return time.perf_counter() - server.started_s
