"""accuracy.rotation_*: a bake whose environment is turned, against truth; the worst of the rotations and maps.

Tiles and shadow rays stay as they were baked, power and moments of the light in each tile are those of the turned map.
The context has the same for a bake that was not made for it, and for a fresh bake of the turned map.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.figure import Figure
from bench.points import lit_points
from bench.relit import bake, compare, documents, figures
from bench.scenes import LAMBERT, environments, teapot_on_table
from relume.environments.model import Environment
from relume.estimated import Estimated
from relume.light.tiles import MIN_LIGHTS

_TURNS = (0, 1 / 32, 1 / 8, 1 / 4, 1 / 2)  # whole texels of any map as wide as a multiple of 32


def measure(tiny: bool) -> list[Figure]:
    """Compare the bakes of each map at every turn, all by one truth."""
    num_points, num_lights = (20, 100) if tiny else (1000, 4000)
    terms = documents("rotation")
    found: dict[str, dict[str, Estimated]] = {name: {} for name in terms}
    for environment in environments()[: 1 if tiny else 3]:
        lit = lit_points(teapot_on_table(environment, (LAMBERT,), (LAMBERT,)), (320, 320), num_points, MIN_LIGHTS, None)
        bakes = {kind: bake(environment, num_lights, kind == "relightable") for kind in ("relightable", "plain")}
        for turn in _TURNS:
            light = _turned(environment, turn)
            kinds = {**bakes, "fresh": bake(light, num_lights, False)}
            for (name, kind), error in compare(lit, kinds, light, terms, 500 if tiny else 0).items():
                found[name][f"{kind}, {environment.name}, {360 * turn:g}°"] = error
    return figures(found, {"view_samples": num_points, "lights": num_lights})


def _turned(environment: Environment, turn: float) -> Environment:
    """The map turned by a share of a whole turn, as an image."""
    columns = round(turn * environment.radiance.shape[1])
    return replace(environment, radiance=np.roll(environment.radiance, -columns, axis=1))
