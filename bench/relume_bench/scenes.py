"""Scenes for measurements: a teapot on a table, and environments, real ones if available."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import texel_directions
from relume.assets.environments.read_environment import read_environment
from relume.assets.environments.studio import studio
from relume.scene.examples.still_life.grids import GridSurface
from relume.scene.examples.still_life.still_life import look_at
from relume.scene.examples.still_life.teapot import teapot
from relume.scene.model import Material, Scene
from relume.scene.scene_folder import make_scene

REAL = ("debevec_grace_latlong", "debevec_stpeters_latlong", "polyhaven_venice_sunset_1k")
Terms = tuple[Mapping[str, Any], ...]

LAMBERT: dict[str, Any] = {"model": "lambert", "color": [0.5, 0.5, 0.5]}


def cook_torrance(sigma: float) -> dict[str, Any]:
    """A bright rough conductor-like highlight; the same in all channels."""
    return {"model": "cook_torrance", "color": [1.0, 1.0, 1.0], "params": {"sigma": sigma, "ior": 1.5}}


def shared_data() -> Path:
    """Folder of real data next to the checkout, or RELUME_SHARED_DATA; it may not exist."""
    data_folder = Path(__file__).resolve().parents[3] / "shared" / "data"
    return Path(os.environ.get("RELUME_SHARED_DATA", data_folder))


def environments() -> list[Environment]:
    """Three real maps, or the generated ones if they are missing."""
    paths = [shared_data() / "envmaps" / f"{name}.hdr" for name in REAL]
    if all(path.is_file() for path in paths):
        return [read_environment(path, path.stem) for path in paths]
    return generated_environments()


def generated_environments() -> list[Environment]:
    """The studio and two environments with a sun."""
    return [
        studio(),
        *(make_sun_environment(f"{name} sun (generated)", y) for name, y in (("high", 0.8), ("low", 0.15))),
    ]


def make_sun_environment(name: str, height: float, num_rows: int = 256, spread: float = 0.0004) -> Environment:
    """An environment with a sun whose radiance falls to 1/e at 1 − cos = spread, with constant power.

    Args:
        name: name of the environment.
        height: height of the sun; the tangent of its elevation is about 1.28 times this.
        num_rows: number of rows of the map, which is twice as wide.
        spread: 1 − cos of the sun's angular radius.
    """
    d = texel_directions(num_rows, 2 * num_rows)
    sun_direction = np.array([0.6, height, 0.5]) / np.linalg.norm([0.6, height, 0.5])
    glow = np.exp((d @ sun_direction - 1) / spread)[..., None] * np.array([1.6, 1.4, 1.04]) / spread
    environment_radiance = np.where(d[..., 1:2] > 0, 0.4 + 0.6 * d[..., 1:2], 0.1) * [0.5, 0.7, 1.0]
    return Environment(name, (environment_radiance + glow).astype(np.float32))


def teapot_on_table(environment: Environment, pot: Terms, table: Terms, camera_distance: float = 1.0) -> Scene:
    """Newell's teapot, 0.16 m high, on a table of 3 × 3 m; view "front", square images frame the pot.

    Args:
        environment: environment of the scene.
        pot, table: terms of the two materials, "Teapot" and "Table".
        camera_distance: 1 for a pot that covers about a third of the image.
    """
    pot_surface = teapot(12, 0.16)
    corners = np.array([[-1.5, 0, 1.5], [1.5, 0, 1.5], [1.5, 0, -1.5], [-1.5, 0, -1.5]], float)
    flat = GridSurface(
        corners - [0, 2e-4, 0],
        np.tile([0.0, 1.0, 0.0], (4, 1)),
        np.tile([1.0, 0.0, 0.0], (4, 1)),
        corners[:, [0, 2]],
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    x, y, z = np.array([0.10, 0.26, 0.62]) * camera_distance
    camera = look_at("front", (x, y, z), (0.0, 0.07, 0.0), float(np.radians(28.0)))
    materials = (Material("Teapot", tuple(map(dict, pot))), Material("Table", tuple(map(dict, table))))
    meshes = (pot_surface.mesh("Teapot", 0), flat.mesh("Table", 1))
    return make_scene("Teapot on a table", meshes, materials, (camera,), environment)
