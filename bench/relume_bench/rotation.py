"""accuracy.rotation_*: error of a bake with a rotated environment; the worst of the rotations and maps.

Tiles are refined for the rotated map as in a picture. The context has the same for a relightable bake, and for a new
bake of the rotated map.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.assets.environments.environment import Environment
from relume.core.jackknife import JackknifeEstimate
from relume.lights.tile_subdivision import MIN_LIGHTS
from relume_bench.figure import Figure
from relume_bench.points import sample_lit_surface
from relume_bench.relighting import bake, compare, documents, figures
from relume_bench.scenes import LAMBERT, environments, teapot_on_table

_ROTATIONS = (0, 1 / 32, 1 / 8, 1 / 4, 1 / 2)  # whole texels of any map whose width is a multiple of 32


def measure(tiny: bool) -> list[Figure]:
    """Compare the bakes of each map at every rotation, all with one reference."""
    num_positions, num_lights = (20, 100) if tiny else (1000, 4000)
    terms = documents("rotation")
    errors: dict[str, dict[str, JackknifeEstimate]] = {name: {} for name in terms}
    for environment in environments()[: 1 if tiny else 3]:
        lit_samples = sample_lit_surface(
            teapot_on_table(environment, (LAMBERT,), (LAMBERT,)), (320, 320), num_positions, MIN_LIGHTS, None
        )
        bakes = {kind: bake(environment, num_lights, kind == "relightable") for kind in ("relightable", "plain")}
        for rotation in _ROTATIONS:
            light = _rotate_map(environment, rotation)
            bakes_by_type = {**bakes, "fresh": bake(light, num_lights, False)}
            for (name, kind), error in compare(lit_samples, bakes_by_type, light, terms, 500 if tiny else 0).items():
                errors[name][f"{kind}, {environment.name}, {360 * rotation:g}°"] = error
    return figures(errors, {"view_samples": num_positions, "lights": num_lights})


def _rotate_map(environment: Environment, rotation: float) -> Environment:
    """Rotate the map by a fraction of a full turn, as an image."""
    columns = round(rotation * environment.radiance.shape[1])
    return replace(environment, radiance=np.roll(environment.radiance, -columns, axis=1))
