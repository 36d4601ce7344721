"""Pictures with curves opened, and changes to looks of the still life."""

from __future__ import annotations

import numpy as np
from sessions import BUDGET, settle

from relume.memory import Memory
from relume.picture.picture import Picture

BALL, WALL = "/materials/Ball/terms/1/curves/", "/materials/Wall/terms/0/curves/"


def quiet(share):
    """Progress that nobody watches."""


def opened(transfer, *touched, cache=None, view="front", look=None):
    """An exact picture, some curves opened one after another."""
    picture = Picture(transfer, view, cache or Memory(BUDGET))
    if look is not None:
        picture.set_look(look)
    settle(picture)
    for pointer in touched:
        picture.touch(pointer)
        settle(picture)
    return picture


def sigma(value, **more):
    def change(document):
        document["materials"]["Ball"]["terms"][1]["params"].update(sigma=value, **more)

    return change


def ball_alone(document):
    """The ball with a single coloured, textured term."""
    document["materials"]["Ball"]["terms"] = [
        {"model": "cook_torrance", "color": [0.9, 0.5, 0.2], "params": {"sigma": 0.3}, "texture": "diffuse"}
    ]


def pixels_of_ball_alone(transfer, view="front"):
    """Pixels that see nothing but the ball. (height, width) bool"""
    v = transfer.views[view]
    rows = v.rows(2)
    count = np.bincount(v.pixel, minlength=v.width * v.height)
    of_ball = np.bincount(v.pixel[rows], minlength=v.width * v.height)
    return (count == of_ball).reshape(v.height, v.width)


def turned_by(degrees):
    def turn(document):
        document["environment"]["rotation"] = degrees

    return turn
