"""Materials and lights of the looks in tests."""

from __future__ import annotations

import math

from relume.scene.model import Light, Material

MATERIALS = [
    Material("Teapot", ({"model": "lambert", "color": [0.1, 0.02, 0.02]}, {"model": "cook_torrance"})),
    Material("a/b~c", ({"model": "ggx", "color": [1, 1, 1], "texture": None, "params": {"f0": [1, 0.8, 0.3]}},)),
]


KEY = Light("Key", {"kind": "spot", "position": [1.0, 2.0, 3.0]})


PANEL = Light("Panel", {"kind": "mesh", "material": "Teapot", "emission": [5.0, 5.0, 4.0]})


LIGHTS = [KEY, PANEL]


NAN, INF = math.nan, math.inf


SIGMA = "/materials/Teapot/terms/1/params/sigma"


CURVES = "/materials/Teapot/terms/1/curves"


def replace(path, value):
    return [{"op": "replace", "path": path, "value": value}]


def make_flat_curve(count):
    return [[90 * k / (count - 1), 1.0] for k in range(count)]
