"""accuracy.swap_*: a bake whose environment is exchanged for another, against truth; the worst of all pairs of maps.

As `bench.rotation`. A fresh bake of each map stands beside those that were made for another.
"""

from __future__ import annotations

from bench.figure import Figure
from bench.points import lit_points
from bench.relit import bake, compare, documents, figures
from bench.scenes import LAMBERT, environments, teapot_on_table
from relume.estimated import Estimated
from relume.light.tiles import MIN_LIGHTS


def measure(tiny: bool) -> list[Figure]:
    """Compare all bakes that are shown in a map, by one truth."""
    num_points, num_lights = (20, 100) if tiny else (400, 4000)
    terms = documents("swap")
    found: dict[str, dict[str, Estimated]] = {name: {} for name in terms}
    maps = environments()[: 2 if tiny else 3]
    lit = lit_points(teapot_on_table(maps[0], (LAMBERT,), (LAMBERT,)), (320, 320), num_points, MIN_LIGHTS, None)
    bakes = {
        (kind, light.name): bake(light, num_lights, kind == "relightable")
        for kind in ("relightable", "plain")
        for light in maps
    }
    for light in maps:
        kinds = {
            ("fresh" if made_for == light.name else f"{kind}, {made_for}"): baked
            for (kind, made_for), baked in bakes.items()
            if kind == "plain" or made_for != light.name
        }
        for (name, kind), error in compare(lit, kinds, light, terms, 500 if tiny else 0).items():
            found[name][f"{kind} → {light.name}"] = error
    return figures(found, {"view_samples": num_points, "lights": num_lights})
