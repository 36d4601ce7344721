"""accuracy.swap_*: error of a bake with a replaced environment; the worst of all pairs of maps.

As `relume_bench.rotation`. The context also has a new bake of each map.
"""

from __future__ import annotations

from relume.core.jackknife import JackknifeEstimate
from relume.lights.tile_subdivision import MIN_LIGHTS
from relume_bench.figure import Figure
from relume_bench.points import sample_lit_surface
from relume_bench.relighting import bake, compare, documents, figures
from relume_bench.scenes import LAMBERT, environments, teapot_on_table


def measure(tiny: bool) -> list[Figure]:
    """Compare all bakes under each map, with one reference."""
    num_positions, num_lights = (20, 100) if tiny else (400, 4000)
    terms = documents("swap")
    errors: dict[str, dict[str, JackknifeEstimate]] = {name: {} for name in terms}
    maps = environments()[: 2 if tiny else 3]
    lit_samples = sample_lit_surface(
        teapot_on_table(maps[0], (LAMBERT,), (LAMBERT,)), (320, 320), num_positions, MIN_LIGHTS, None
    )
    bakes = {
        (kind, light.name): bake(light, num_lights, kind == "relightable")
        for kind in ("relightable", "plain")
        for light in maps
    }
    for light in maps:
        bakes_by_type = {
            ("fresh" if bake_environment == light.name else f"{kind}, {bake_environment}"): baked
            for (kind, bake_environment), baked in bakes.items()
            if kind == "plain" or bake_environment != light.name
        }
        for (name, kind), error in compare(lit_samples, bakes_by_type, light, terms, 500 if tiny else 0).items():
            errors[name][f"{kind} → {light.name}"] = error
    return figures(errors, {"view_samples": num_positions, "lights": num_lights})
