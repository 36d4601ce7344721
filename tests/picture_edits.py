"""Pictures with prepared curves, and edits of looks of the still life."""

from __future__ import annotations

import numpy as np
from session_edits import BUDGET, run_until_exact

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture

BALL, WALL = "/materials/Ball/terms/1/curves/", "/materials/Wall/terms/0/curves/"


def ignore_progress(fraction):
    """Ignore the progress of a job."""


def open_exact_picture(transfer, *touched, cache=None, view="front", look=None):
    """An exact picture in which curves were prepared one after another."""
    picture = Picture(transfer, view, cache or Cache(BUDGET))
    if look is not None:
        picture.set_look(look)
    run_until_exact(picture)
    for pointer in touched:
        picture.prepare(pointer)
        run_until_exact(picture)
    return picture


def set_sigma(value, **more):
    def change(document):
        document["materials"]["Ball"]["terms"][1]["params"].update(sigma=value, **more)

    return change


def set_single_term_ball(document):
    """Give the ball a single colored, textured term."""
    document["materials"]["Ball"]["terms"] = [
        {"model": "cook_torrance", "color": [0.9, 0.5, 0.2], "params": {"sigma": 0.3}, "texture": "diffuse"}
    ]


def find_pure_ball_pixels(transfer, view="front"):
    """Pixels that show only the ball. (height, width) bool"""
    v = transfer.views[view]
    rows = v.rows(2)
    count = np.bincount(v.pixel, minlength=v.width * v.height)
    ball_count = np.bincount(v.pixel[rows], minlength=v.width * v.height)
    return (count == ball_count).reshape(v.height, v.width)


def rotate_environment(degrees):
    def change(document):
        document["environment"]["rotation"] = degrees

    return change
