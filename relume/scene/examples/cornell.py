"""A Cornell box with a white room, red and green walls and two blocks, lit through a skylight or by an area light."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import texel_directions
from relume.scene.examples.still_life.grids import GridSurface, merge_surfaces, rotation_y
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.model import Camera, Light, Material, Mesh, Scene
from relume.scene.scene_folder import make_scene

F64 = NDArray[np.float64]

WHITE, GREEN, RED = (0.73, 0.71, 0.68), (0.12, 0.45, 0.15), (0.63, 0.065, 0.05)
SKYLIGHT = 0.45  # half the side of the opening in the roof; the room is 2 m wide, high and deep
# half diffuse, half a highlight with an editable exponent: [3, 300] in Nguyen 2010
GLOSSY_FLOOR: tuple[dict[str, Any], ...] = (
    {"model": "lambert", "color": [0.36, 0.35, 0.33]},
    {"model": "blinn_phong", "color": [0.12, 0.12, 0.12], "params": {"exponent": 100.0}},
)
CEILING_LIGHT_RADIANCE, CEILING_LIGHT_SIZE, CEILING_LIGHT_GAP = (
    (18.0, 13.5, 8.5),
    (0.5, 0.4),
    2e-3,
)  # radiance; meters, distance to the ceiling
SUN_DIRECTION = np.array([0.22, 1.0, 0.12])
SUN_RADIUS = np.radians(4.0)


@cache
def cornell_box(is_floor_glossy: bool = False) -> Scene:
    """Return a room of x, z = −1 to 1 and y = 0 to 2, open toward the camera; view "front", for square images.

    Args:
        is_floor_glossy: the floor has the terms `GLOSSY_FLOOR`.
    """
    meshes, materials = _room(_roof())
    if is_floor_glossy:
        materials[0] = Material("Floor", GLOSSY_FLOOR)
    return make_scene("Cornell box", meshes, materials, [_camera()], sunny_environment())


@cache
def lamplit_cornell_box() -> Scene:
    """Return the room with a closed ceiling, at night; the light "Lamp" is an emissive mesh."""
    meshes, materials = _room(rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2)))
    x, z = CEILING_LIGHT_SIZE[0] / 2, CEILING_LIGHT_SIZE[1] / 2
    plate = rectangle((-x, 2 - CEILING_LIGHT_GAP, -z), (2 * x, 0, 0), (0, 0, 2 * z))
    area_light = Light("Lamp", {"kind": "mesh", "material": "Lamp", "emission": list(CEILING_LIGHT_RADIANCE)})
    return make_scene(
        "Cornell box by lamplight",
        [*meshes, plate.mesh("Lamp", len(materials))],
        [*materials, Material("Lamp", ({"model": "lambert", "color": list(WHITE)},), double_sided=False)],
        [_camera()],
        Environment("night", np.full((4, 8, 3), 1e-6, np.float32)),
        lights=[area_light],
    )


def _room(roof: GridSurface) -> tuple[list[Mesh], list[Material]]:
    objects: list[tuple[str, GridSurface, Sequence[float]]] = [
        ("Floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), WHITE),
        ("Walls", merge_surfaces([rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0)), roof]), WHITE),
        ("Red wall", rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0)), RED),
        ("Green wall", rectangle((1, 0, -1), (0, 0, 2), (0, 2, 0)), GREEN),
        ("Tall block", block(0.3, 1.2, 0.3).transform(rotation_y(18.0), (-0.33, 0.0, -0.28)), WHITE),
        ("Short block", block(0.3, 0.6, 0.3).transform(rotation_y(-17.0), (0.34, 0.0, 0.38)), WHITE),
    ]
    meshes = [surface.mesh(name, k) for k, (name, surface, _) in enumerate(objects)]
    materials = [Material(name, ({"model": "lambert", "color": list(color)},)) for name, _, color in objects]
    return meshes, materials


def _camera() -> Camera:
    return look_at("front", (0.0, 1.0, 4.9), (0.0, 1.0, 0.0), float(np.radians(30.0)))


def sunny_environment(
    sun_direction: Shaped[F64, " 3"] = SUN_DIRECTION, rows: int = 256, radius: float = SUN_RADIUS
) -> Environment:
    """Return a blue environment with a sun disk, hazy by default; black below the horizon.

    Args:
        sun_direction: toward the sun. rows: number of rows of the map, which is twice as wide.
        radius: radius of the sun, radians; its radiance grows as the radius shrinks.
    """
    directions = texel_directions(rows, 2 * rows).astype(np.float64)
    cosine = directions @ (sun_direction / np.linalg.norm(sun_direction))
    edge = np.clip((cosine - np.cos(1.2 * radius)) / (np.cos(0.8 * radius) - np.cos(1.2 * radius)), 0, 1)
    height = directions[..., 1:2]
    blue = np.where(height > 0, 0.25 + 0.55 * height, 0.0) * [0.55, 0.75, 1.0]
    disc = np.array([1350.0, 1230.0, 1050.0]) * (SUN_RADIUS / radius) ** 2
    radiance = blue + (edge**2 * (3 - 2 * edge))[..., None] * disc
    return Environment("sunny sky", radiance.astype(np.float32))


def rectangle(corner: Sequence[float], u: Sequence[float], v: Sequence[float]) -> GridSurface:
    """Return the rectangle corner + [0, 1] u + [0, 1] v with normal u × v.

    Args:
        corner: one corner (x, y, z), meters. u, v: edges from there, meters.
    """
    start, along, up = (np.asarray(a, np.float64) for a in (corner, u, v))
    normal = np.cross(along, up)
    return GridSurface(
        start + np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) @ np.stack([along, up]),
        np.tile(normal / np.linalg.norm(normal), (4, 1)),
        np.tile(along / np.linalg.norm(along), (4, 1)),
        np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )


def _roof() -> GridSurface:
    """Four strips around the skylight, facing down."""
    s, strip = SKYLIGHT, 1 - SKYLIGHT
    return merge_surfaces(
        [
            rectangle((-1, 2, -1), (2, 0, 0), (0, 0, strip)),
            rectangle((-1, 2, s), (2, 0, 0), (0, 0, strip)),
            rectangle((-1, 2, -s), (strip, 0, 0), (0, 0, 2 * s)),
            rectangle((s, 2, -s), (strip, 0, 0), (0, 0, 2 * s)),
        ]
    )


def block(half_width: float, height: float, half_depth: float) -> GridSurface:
    """Return a block on y = 0 around the y axis, without its invisible bottom.

    Args:
        half_width: half width along x, meters. height: height along y, meters. half_depth: half depth along z, meters.
    """
    x, z = half_width, half_depth
    corners = [(-x, z), (x, z), (x, -z), (-x, -z)]
    sides = [
        rectangle((a[0], 0, a[1]), (b[0] - a[0], 0, b[1] - a[1]), (0, height, 0))
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    return merge_surfaces([*sides, rectangle((-x, height, z), (2 * x, 0, 0), (0, 0, -2 * z))])
