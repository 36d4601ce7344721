"""A room lit through one window, almost entirely by indirect illumination."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from relume.scene.examples.cornell import block, rectangle, sunny_environment
from relume.scene.examples.still_life.grids import GridSurface, merge_surfaces, rotation_y, sphere
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Material, Scene
from relume.scene.scene_folder import make_scene

_WIDTH, _HEIGHT, _DEPTH = 5.0, 2.7, 4.0
_SILL, _LINTEL, _FROM, _TO = 0.8, 2.3, -1.2, 0.6  # edges of the window in the left wall
_SUN_DIRECTION = np.array([-1.0, 0.75, 0.25])
_PLASTER, _WOOD, _CLOTH = [0.78, 0.76, 0.72], [0.38, 0.24, 0.13], [0.16, 0.28, 0.45]


@cache
def interior() -> Scene:
    """Return a room of 5 × 2.7 × 4 m with a table, ball, bench and polished floor; view "front", for square images."""
    objects: list[tuple[str, GridSurface, tuple[dict[str, Any], ...]]] = [
        ("Floor", rectangle((-2.5, 0, 2), (_WIDTH, 0, 0), (0, 0, -_DEPTH)), (_lambert(_WOOD), _polish(60.0))),
        ("Walls", merge_surfaces([_walls(), _wall_with_window()]), (_lambert(_PLASTER),)),
        ("Table", _table(), (_lambert([0.5, 0.42, 0.33]), _polish(120.0))),
        ("Bench", block(1.1, 0.42, 0.3).transform(np.eye(3), (0.9, 0.0, -1.6)), (_lambert(_CLOTH),)),
        (
            "Ball",
            sphere(0.17, 48).transform(np.eye(3), (0.15, 0.93, 0.05)),
            (_lambert([0.6, 0.1, 0.06]), _polish(250.0)),
        ),
    ]
    meshes = [surface.mesh(name, k) for k, (name, surface, _) in enumerate(objects)]
    materials = [Material(name, terms) for name, _, terms in objects]
    camera = look_at("front", (1.0, 1.5, 1.95), (-0.25, 1.0, -0.6), float(np.radians(62.0)))
    environment = sunny_environment(
        _SUN_DIRECTION, rows=512
    )  # with fewer rows, texels show as stripes of light on the floor
    return make_scene("Interior", meshes, materials, [camera], environment)


def _lambert(color: list[float]) -> dict[str, Any]:
    return {"model": "lambert", "color": color}


def _polish(exponent: float) -> dict[str, Any]:
    return {"model": "blinn_phong", "color": [0.04, 0.04, 0.04], "params": {"exponent": exponent}}


def _walls() -> GridSurface:
    """Ceiling and three walls, facing inward."""
    return merge_surfaces(
        [
            rectangle((-2.5, _HEIGHT, -2), (_WIDTH, 0, 0), (0, 0, _DEPTH)),
            rectangle((-2.5, 0, -2), (_WIDTH, 0, 0), (0, _HEIGHT, 0)),
            rectangle((2.5, 0, -2), (0, 0, _DEPTH), (0, _HEIGHT, 0)),
            rectangle((2.5, 0, 2), (-_WIDTH, 0, 0), (0, _HEIGHT, 0)),
        ]
    )


def _wall_with_window() -> GridSurface:
    """Four strips around the window at x = −2.5, and its reveals."""
    deep, tall = _TO - _FROM, _LINTEL - _SILL
    strips = [(0.0, _SILL, -2.0, 2.0), (_LINTEL, _HEIGHT, -2.0, 2.0), (_SILL, _LINTEL, -2.0, _FROM)]
    strips.append((_SILL, _LINTEL, _TO, 2.0))
    return merge_surfaces(
        [rectangle((-2.5, low, to), (0, 0, start - to), (0, high - low, 0)) for low, high, start, to in strips]
        + [
            rectangle((-2.7, _SILL, _TO), (0.2, 0, 0), (0, 0, -deep)),
            rectangle((-2.7, _LINTEL, _FROM), (0.2, 0, 0), (0, 0, deep)),
            rectangle((-2.7, _SILL, _FROM), (0.2, 0, 0), (0, tall, 0)),
            rectangle((-2.5, _SILL, _TO), (-0.2, 0, 0), (0, tall, 0)),
        ]
    )


def _table() -> GridSurface:
    """A tabletop with an underside, on four legs."""
    legs = [block(0.035, 0.7, 0.035).transform(np.eye(3), (x, 0.0, z)) for x in (-0.55, 0.55) for z in (-0.33, 0.33)]
    top = block(0.65, 0.05, 0.42).transform(np.eye(3), (0.0, 0.7, 0.0))
    under = rectangle((-0.65, 0.7, -0.42), (1.3, 0, 0), (0, 0, 0.84))
    return merge_surfaces([*legs, top, under]).transform(rotation_y(12.0), (0.0, 0.0, 0.0))
