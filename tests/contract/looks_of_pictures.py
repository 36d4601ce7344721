"""Looks that pictures are held to: two lamps beside the environment, and what a hand does to them."""

import pytest

LAMP = {"kind": "point", "position": [0.6, 0.8, 0.9], "emission": [2.0, 1.5, 1.0]}
PANEL = {
    "kind": "rectangle", "position": [-0.8, 1.2, 0.8], "direction": [1, -1, -1], "size": [0.5, 0.4],
    "emission": [4.0, 4.0, 6.0],
}  # fmt: skip
LIGHTS = {"Lamp": LAMP, "Panel": PANEL}
LOBE, EXPONENT = "/materials/Wall/terms/1/curves/theta_h", "/materials/Wall/terms/1/params/exponent"


def lit(*changes):
    """A change of the look: two lamps beside the environment, and what else is given."""

    def change(document):
        document["lights"].update(LIGHTS)
        for other in changes:
            other(document)

    return change


def exponent(value):
    def change(document):
        document["materials"]["Wall"]["terms"][1]["params"]["exponent"] = float(value)

    return change


def drawn(document):
    curve = {"points": [[0, 30], [10, 12], [40, 0.5], [90, 0]], "channels": "rb"}
    document["materials"]["Wall"]["terms"][1]["curves"] = {"theta_h": curve}


def painted(document):
    document["materials"]["Floor"]["terms"][0]["color"] = [0.1, 0.7, 0.3]


def matt(document):
    del document["materials"]["Wall"]["terms"][1]


def replaced(document):
    document["materials"]["Wall"]["terms"] = [{"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.3}}]


def light(name, **fields):
    return lambda document: document["lights"].update({name: LIGHTS[name] | fields})


def environment(**fields):
    return lambda document: document["environment"].update(fields)


def transport(**fields):
    return lambda document: document["transport"].update(fields)


def everything(document):
    for change in (drawn, painted, light("Panel", scale=0.5), environment(rotation=80.0), transport(bounces=1)):
        change(document)


EDITS = {  # what a hand has touched before, and what it then does
    "a curve drawn": (LOBE, drawn),
    "a curve drawn that nobody has touched": (None, drawn),
    "a parameter, its curve open": (LOBE, exponent(60)),
    "a parameter held": (EXPONENT, exponent(60)),
    "a diffuse colour": ("/materials/Floor/terms/0/color", painted),
    "another model": (LOBE, replaced),
    "brightness of a lamp": ("/lights/Lamp", light("Lamp", scale=0.3)),
    "a lamp moved": ("/lights/Lamp", light("Lamp", position=[-0.4, 0.9, 0.7])),
    "a lamp switched off": (None, light("Panel", on=False)),
    "tint of the environment": (None, environment(scale=0.5, color=[1.0, 0.6, 0.4])),
    "the environment turned": ("/environment/rotation", environment(rotation=40.0)),
    "fewer paths": (None, transport(bounces=1)),
    "all at once": (LOBE, everything),
}
# of every kind one: a curve, a model, a light, light that turns, and all
OFTEN = ("a curve drawn", "another model", "a lamp moved", "the environment turned", "all at once")
EDITS_OFTEN = [pytest.param(edit, marks=[pytest.mark.slow] * (edit not in OFTEN)) for edit in EDITS]
