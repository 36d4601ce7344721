"""Two organic shapes on a polished floor, with reflections between them and the floor."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from relume.scene.examples.cornell import rectangle, sunny_environment
from relume.scene.examples.still_life.grids import GridSurface, closed_grid_surface
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Material, Scene
from relume.scene.scene_folder import make_scene

_SUN_DIRECTION = np.array([0.7, 0.9, 0.6])
_ROWS, _COLUMNS = 96, 160


@cache
def tableau() -> Scene:
    """Return a folded and a waisted pebble, about 1 m high; view "front", for 4:3 images."""
    polish = {"model": "blinn_phong", "color": [0.1, 0.1, 0.1], "params": {"exponent": 100.0}}
    gloss = {"model": "cook_torrance", "color": [1.0, 1.0, 1.0], "params": {"sigma": 0.2, "ior": 1.5}}
    folded = _shape(0.62, 0.55, 0.16, 5, 0.35).transform(np.eye(3), (-0.62, 0.5, -0.1))
    waisted = _shape(0.42, 0.8, 0.1, 3, 1.4).transform(np.eye(3), (0.5, 0.74, 0.05))
    objects: list[tuple[str, GridSurface, tuple[dict[str, Any], ...]]] = [
        ("Floor", rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8)), (_lambert([0.4, 0.38, 0.35]), polish)),
        ("Folded", folded, (_lambert([0.7, 0.2, 0.1]),)),
        ("Waisted", waisted, (_lambert([0.2, 0.4, 0.7]), gloss)),
    ]
    meshes = [surface.mesh(name, k) for k, (name, surface, _) in enumerate(objects)]
    materials = [Material(name, terms) for name, _, terms in objects]
    camera = look_at("front", (0.3, 1.7, 4.2), (-0.05, 0.55, 0.0), float(np.radians(30.0)))
    return make_scene("Tableau", meshes, materials, [camera], sunny_environment(_SUN_DIRECTION))


def _lambert(color: list[float]) -> dict[str, Any]:
    return {"model": "lambert", "color": color}


def _shape(radius: float, half_height: float, depth: float, folds: int, waist: float) -> GridSurface:
    """An ellipsoid with twisted folds and a narrow waist; a pinhole is open at each pole."""
    theta = np.linspace(0.01, np.pi - 0.01, _ROWS)[:, None]
    phi = -np.linspace(0, 2 * np.pi, _COLUMNS)[None, :]
    folded = 1 + depth * np.sin(theta) ** 2 * np.sin(folds * phi + 2.5 * np.cos(theta))
    across = radius * np.sin(theta) * folded * (1 - 0.25 * waist * np.sin(theta) ** 8)
    positions = np.stack([across * np.cos(phi), half_height * np.cos(theta) + 0 * phi, -across * np.sin(phi)], -1)
    uvs = np.stack(np.broadcast_arrays(-phi / (2 * np.pi), theta / np.pi), -1)
    return closed_grid_surface(positions, uvs)
