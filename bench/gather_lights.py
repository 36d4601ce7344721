"""gather.light_move_fps, gather.panel_move_fps and gather.light_scale_fps: lamps in the room of bench/gather.py.

A point light and a rectangle of 0.5 × 0.5 m under the ceiling are moved, and the rectangle is dimmed, held by the hand;
from the look to the encoded bytes, medians. What holding it makes is made before. A frame of a moved lamp may be
near the look: at rest it is shaded exactly.
"""

from __future__ import annotations

import copy
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.figure import Figure
from bench.gather import bake, recipe_of, settle
from bench.timing import seconds
from relume.look import validate
from relume.scene.cornell import cornell_box
from relume.transfer.cache import FrozenCache
from relume.transfer.opened import Transfer, open_transfer
from relume.transfer.picture import Picture

_NAMES = ("gather.light_move_fps", "gather.panel_move_fps", "gather.light_scale_fps")
_SPEED = "frames/s"
_POINT: dict[str, Any] = {"kind": "point", "emission": [1.0, 1.0, 1.0]}
_PANEL: dict[str, Any] = {"kind": "rectangle", "direction": [0.0, -1.0, 0.0], "emission": [4.0, 4.0, 4.0]}


def measure(tiny: bool) -> list[Figure]:
    """Three drags."""
    num_frames, recipe = 3 if tiny else 24, recipe_of(tiny)
    with tempfile.TemporaryDirectory() as folder:
        scene = cornell_box(is_floor_glossy=True)
        transfer = open_transfer(bake(scene, recipe, Path(folder) / "gather.zarr").path)
        places = [{"position": [float(x), 1.7, 0.2]} for x in np.linspace(-0.4, 0.4, num_frames)]
        scales = [{**places[-1], "scale": float(scale)} for scale in np.geomspace(0.1, 3, num_frames)]
        drags = [
            [_POINT | place for place in places],
            [_PANEL | place for place in places],
            [_PANEL | scale for scale in scales],
        ]
        found = [_frames_s(transfer, Picture(transfer, "front", FrozenCache(4 << 30)), drag) for drag in drags]
    return [
        Figure(name, 1 / float(np.median(taken)), _SPEED, {
            "ms_p50": 1e3 * float(np.median(taken)), "ms_max": 1e3 * max(taken), "prepared_once_s": prepared_s,
            "size": list(recipe.size),
        })
        for name, (taken, prepared_s) in zip(_NAMES, found, strict=True)
    ]  # fmt: skip


def _frames_s(transfer: Transfer, picture: Picture, lamps: Sequence[dict[str, Any]]) -> tuple[list[float], float]:
    """Seconds of each frame of a drag, and of what is made once for it: rows on touch, the lamp's image when dimmed.

    The first two frames are left out: one is at rest, the other asks for that image, and compiles.
    """
    taken, prepared_s = [], 0.0
    for k, lamp in enumerate(lamps):
        document = copy.deepcopy(transfer.default_look)
        document["lights"]["Lamp"] = lamp
        look = validate(document, transfer.default_look)
        began = time.perf_counter()
        picture.set_look(look)
        picture.encode(picture.advance(None).tiles, "rgb9e5")
        taken.append(time.perf_counter() - began)
        if k == 0:
            settle(picture)
            picture.touch("/lights/Lamp")
        if k <= 1:
            prepared_s += seconds(partial(settle, picture))
    return taken[2:], prepared_s
