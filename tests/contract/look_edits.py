"""Looks for picture tests: two lights beside the environment, and edits."""

import pytest

POINT_LIGHT = {"kind": "point", "position": [0.6, 0.8, 0.9], "emission": [2.0, 1.5, 1.0]}
PANEL = {
    "kind": "rectangle", "position": [-0.8, 1.2, 0.8], "direction": [1, -1, -1], "size": [0.5, 0.4],
    "emission": [4.0, 4.0, 6.0],
}  # fmt: skip
LIGHTS = {"Bulb": POINT_LIGHT, "Panel": PANEL}
LOBE, EXPONENT = "/materials/Wall/terms/1/curves/theta_h", "/materials/Wall/terms/1/params/exponent"


def add_lights(*changes):
    """A change that adds two lights to the environment, then applies further changes."""

    def change(document):
        document["lights"].update(LIGHTS)
        for edit in changes:
            edit(document)

    return change


def set_exponent(value):
    def change(document):
        document["materials"]["Wall"]["terms"][1]["params"]["exponent"] = float(value)

    return change


def draw_curve(document):
    curve = {"points": [[0, 30], [10, 12], [40, 0.5], [90, 0]], "channels": "rb"}
    document["materials"]["Wall"]["terms"][1]["curves"] = {"theta_h": curve}


def set_floor_color(document):
    document["materials"]["Floor"]["terms"][0]["color"] = [0.1, 0.7, 0.3]


def remove_glossy_term(document):
    del document["materials"]["Wall"]["terms"][1]


def replace_terms(document):
    document["materials"]["Wall"]["terms"] = [{"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.3}}]


def edit_light(name, **fields):
    return lambda document: document["lights"].update({name: LIGHTS[name] | fields})


def edit_environment(**fields):
    return lambda document: document["environment"].update(fields)


def edit_transport(**fields):
    return lambda document: document["transport"].update(fields)


def apply_all_edits(document):
    for change in (
        draw_curve,
        set_floor_color,
        edit_light("Panel", intensity=0.5),
        edit_environment(rotation=80.0),
        edit_transport(bounces=1),
    ):
        change(document)


EDITS = {  # prepared pointer and the edit that follows
    "a curve drawn": (LOBE, draw_curve),
    "a curve drawn without preparation": (None, draw_curve),
    "a parameter, its curve open": (LOBE, set_exponent(60)),
    "a parameter prepared": (EXPONENT, set_exponent(60)),
    "a diffuse color": ("/materials/Floor/terms/0/color", set_floor_color),
    "another model": (LOBE, replace_terms),
    "intensity of a light": ("/lights/Bulb", edit_light("Bulb", intensity=0.3)),
    "a light moved": ("/lights/Bulb", edit_light("Bulb", position=[-0.4, 0.9, 0.7])),
    "a light switched off": (None, edit_light("Panel", enabled=False)),
    "tint of the environment": (None, edit_environment(intensity=0.5, color=[1.0, 0.6, 0.4])),
    "the environment turned": ("/environment/rotation", edit_environment(rotation=40.0)),
    "fewer paths": (None, edit_transport(bounces=1)),
    "all at once": (LOBE, apply_all_edits),
}
# one of each kind: curve, model, light, rotation, and all
FAST_EDITS = ("a curve drawn", "another model", "a light moved", "the environment turned", "all at once")
MARKED_EDITS = [pytest.param(edit, marks=[pytest.mark.slow] * (edit not in FAST_EDITS)) for edit in EDITS]
