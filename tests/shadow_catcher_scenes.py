"""A ball above a shadow-catcher ground, and edits of its looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tiny_scenes import make_camera, make_tiny_scene, sphere

from relume.scene.model import Light, Material
from relume.scene.shadow_catcher_ground import with_ground

SIZE = (40, 30)
CENTER, RADIUS = np.array([0.0, 0.5, 0.0]), 0.35
RED = Material("Ball", ({"model": "lambert", "color": [0.8, 0.1, 0.1]},))
EMISSIVE_BALL = Light("Ball", {"kind": "mesh", "material": "Ball", "emission": [2.0, 1.0, 0.5], "enabled": False})
CAMERA = make_camera("front", (0.5, 2.2, 3.2), (0, 0.25, 0), 0.7)
POINT_LIGHT = {"kind": "point", "position": [0.4, 2.0, 0.3], "emission": [5.0, 5.0, 5.0]}


def ball_scene(environment):
    """A red ball, which can be emissive, above a ground."""
    ball = sphere("ball", CENTER, RADIUS, 0, num_rings=24)
    scene = make_tiny_scene(ball, camera=CAMERA, environment=environment, materials=[RED])
    return with_ground(replace(scene, lights=(EMISSIVE_BALL,)))


def background(**fields):
    return lambda document: document["background"].update(fields)


def environment(**fields):
    return lambda document: document["environment"].update(fields)


def set_paths(paths):
    return lambda document: document["transport"].update(show=paths)


def plain_ground(document):
    document["materials"]["Ground"]["shadow_catcher"] = False


def changes(*edits):
    def change(document):
        for edit in edits:
            edit(document)

    return change


def set_only_area_light(document):
    document["environment"]["intensity"] = 0.0
    document["lights"]["Lamp"] = POINT_LIGHT


def inner(transfer, name):
    """Pixels with one sample, of a material (None: of the background). (height, width)"""
    view = transfer.views["front"]
    number = 65535 if name is None else list(transfer.material_names).index(name)
    return (view.material_ids() == number) & (np.diff(view.first) == 1).reshape(view.height, view.width)


def set_only_spot_light(document):
    document["environment"]["intensity"] = 0.0
    document["lights"]["Lamp"] = {**POINT_LIGHT, "kind": "spot", "direction": [0.0, -1.0, 0.0], "cone": [15.0, 20.0]}


def set_only_emissive_ball(document):
    document["environment"]["intensity"] = 0.0
    document["lights"]["Ball"]["enabled"] = True
